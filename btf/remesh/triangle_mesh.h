// Triangle meshes: the data, the checks, and the topology that remeshing needs.
//
// A triangle lists its vertices counter-clockwise seen from outside. Vertices and triangles are counted from
// 0 in code and from 1 in messages, as in btf/wang/quad_mesh.h.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/wang/quad_mesh.h"

namespace tessera {

using Triangle = std::array<uint32_t, 3>;

struct TriangleMesh {
  std::vector<Eigen::Vector3f> positions;
  std::vector<Triangle> triangles;
};

// Each quad as two triangles, 2 q and 2 q + 1 of quad q.
[[nodiscard]] std::vector<Triangle> HalvesOf(std::span<const Quad> quads);

// Pieces and handles of a closed surface; genus is summed over the pieces.
struct SurfaceTopology {
  size_t num_components = 0;
  int64_t genus = 0;

  friend bool operator==(const SurfaceTopology&, const SurfaceTopology&) = default;
};

// The topology of a closed, oriented surface. A vertex in which triangles meet without being connected around
// it by edges counts once for each fan. Errors: INVALID_ARGUMENT naming the triangle (missing or repeated
// vertex), the vertex (not finite) or the edge: open, shared by three or more triangles, or run along in the
// same direction by two; RESOURCE_EXHAUSTED naming size and limit (kMaxMeshVertices, kMaxMeshTriangles).
[[nodiscard]] absl::StatusOr<SurfaceTopology> CheckClosedSurface(const TriangleMesh& mesh);

// Turns triangles over until neighbours run against each other along every edge, the fewer ones of each
// component, and then all of them if the volume is negative. A component inside another keeps its own sense:
// wound inwards it is a cavity. Returns how many were turned. Errors: as CheckClosedSurface, and
// INVALID_ARGUMENT naming the edge at which no choice fits.
[[nodiscard]] absl::StatusOr<size_t> OrientOutwards(TriangleMesh& mesh);

}  // namespace tessera
