// Quad meshes and how they are read, made and checked.
//
// A face lists its vertices counter-clockwise seen from the front. Side k of a face runs from vertex k to
// vertex k + 1.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Core>

namespace tessera {

using Quad = std::array<uint32_t, 4>;

struct QuadMesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;  // unit, per vertex, same size as positions
  std::vector<Quad> quads;
};

// What lies across each side of each face.
struct QuadAdjacency {
  struct Across {
    int face = -1;  // -1 at an open boundary
    int side = -1;
  };
  std::vector<std::array<Across, 4>> across;  // [face][side]
};

// Errors: INVALID_ARGUMENT naming the edge (its two vertices and faces) when three or more faces share it, or
// when two faces run along it in the same direction (not orientable as given).
[[nodiscard]] absl::StatusOr<QuadAdjacency> BuildAdjacency(const QuadMesh& mesh);

}  // namespace tessera
