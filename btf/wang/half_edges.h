// The sides of all faces sorted by the edge they lie on: what adjacency and orientation are both read from.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <absl/status/status.h>

#include "btf/wang/quad_mesh.h"

namespace tessera {

struct HalfEdge {
  uint32_t low = 0;   // the edge's lower vertex
  uint32_t high = 0;  // the edge's higher vertex
  uint32_t side = 0;  // 4 face + side

  [[nodiscard]] bool SameEdge(const HalfEdge& other) const { return low == other.low && high == other.high; }
  friend auto operator<=>(const HalfEdge&, const HalfEdge&) = default;
};

// Ascending by edge, then face, then side.
[[nodiscard]] std::vector<HalfEdge> SortedHalfEdges(const QuadMesh& mesh);

// INVALID_ARGUMENT naming the first edge that three or more faces share, and the faces.
[[nodiscard]] absl::Status CheckEdgesManifold(const QuadMesh& mesh, std::span<const HalfEdge> half_edges);

}  // namespace tessera
