// A dressing: one mesh's table quad -> (tile, quarter turns) for one arrangement, independent of any
// material.
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
  nlohmann::json metadata = nlohmann::json::object();
};

// Container of kind "dressing" (codec/FORMAT.md).
[[nodiscard]] absl::StatusOr<std::string> SerializeDressing(const Dressing& dressing);
[[nodiscard]] absl::StatusOr<Dressing> ParseDressing(std::span<const std::byte> bytes);

}  // namespace tessera
