// A dressing: one mesh's table quad -> (tile, quarter turns) for one arrangement, independent of any
// material.
//
//   TESSERA_ASSIGN_OR_RETURN(Dressing dressing, ParseDressing(bytes));
//   dressing.tile[quad], dressing.turns[quad]
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/wang/quad_mesh.h"

namespace tessera {

// Tile side j lies on face side (j + turns) mod 4.
struct Dressing {
  QuadMesh mesh;               // the subdivided mesh
  std::vector<uint32_t> tile;  // [quads], index into the arrangement's list
  std::vector<uint8_t> turns;  // [quads], 0..3
  std::string arrangement_id;
  std::string arrangement_sha256;
  uint64_t seed = 0;
  std::string source_mesh_sha256;  // of the mesh before subdivision
  // Facts of the subdivided mesh: quads, genus, edge_length {min, median, max}, num_breaks, breaks, ..
  nlohmann::json metadata = nlohmann::json::object();
  // Header keys that this version does not know; written back as they were.
  nlohmann::json other_keys = nlohmann::json::object();
};

// Container of kind "dressing" (codec/FORMAT.md). Errors: INVALID_ARGUMENT naming the quad, vertex or shape
// that is wrong, FAILED_PRECONDITION naming both digests when the arrangement is known here with another one.
[[nodiscard]] absl::StatusOr<std::string> SerializeDressing(const Dressing& dressing);
// Safe on hostile bytes. Errors: also those of ParseContainer. Whether neighbours match is not checked here:
// see FindBreaks.
[[nodiscard]] absl::StatusOr<Dressing> ParseDressing(std::span<const std::byte> bytes);

}  // namespace tessera
