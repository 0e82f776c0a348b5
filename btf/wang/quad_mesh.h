// Quad meshes: the data, the checks and what lies across each side.
//
// A face lists its vertices counter-clockwise seen from the front. Side k of a face runs from vertex k to
// vertex k + 1. In code, vertices and faces are counted from 0; messages count them from 1, as modelling
// tools and OBJ files do, and give positions, which an artist can find.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Core>

namespace tessera {

// Most that a mesh may have: 4 million quads, and as many vertices as these have corners.
inline constexpr size_t kMaxMeshQuads = size_t{1} << 22;
inline constexpr size_t kMaxMeshVertices = kMaxMeshQuads * 4;
// Most that a mesh to be remeshed may have: 4 million.
inline constexpr size_t kMaxMeshTriangles = size_t{1} << 22;

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

// OK when there is at least one quad, sizes are within the limits above, every index exists, no quad repeats
// a vertex or has two neighbouring corners at one place, positions are finite, and normals are unit vectors,
// one a vertex. Errors: INVALID_ARGUMENT naming the face or vertex, RESOURCE_EXHAUSTED naming size and limit.
[[nodiscard]] absl::Status ValidateQuadMesh(const QuadMesh& mesh);

// Errors: INVALID_ARGUMENT naming the edge (its two vertices and faces) when three or more faces share it, or
// when two faces run along it in the same direction (not orientable as given). Indices must exist. Cost: one
// sort of the edges.
[[nodiscard]] absl::StatusOr<QuadAdjacency> BuildAdjacency(const QuadMesh& mesh);

// "edge between vertices 3 at (0, 0, 1) and 4 at (0, 1, 1)", for messages.
[[nodiscard]] std::string EdgeName(std::span<const Eigen::Vector3f> positions, uint32_t vertex_a,
                                   uint32_t vertex_b);

// Smooth unit normals, one a vertex: the corner normals of its faces, each weighted by sin(angle) over the
// product of the two side lengths, which is exact on spheres and needs no trigonometry. A vertex without a
// defined normal (unreferenced, or on collapsed faces only) gets +z. Source: [Max1999].
[[nodiscard]] std::vector<Eigen::Vector3f> ComputeNormals(const QuadMesh& mesh);

// The vector that one corner of a face adds to its vertex in ComputeNormals; 0 where the corner is flat.
[[nodiscard]] Eigen::Vector3d WeightedCornerNormal(const QuadMesh& mesh, size_t face, int corner);

// 64 hexadecimal digits: SHA-256 of u32 vertices, u32 quads, then `positions` f32 [v][3], `normals` f32
// [v][3] and `quads` u32 [q][4], all little-endian.
[[nodiscard]] std::string QuadMeshSha256(const QuadMesh& mesh);

}  // namespace tessera
