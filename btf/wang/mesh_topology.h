// Orientation, manifoldness and the topological facts of a quad mesh.
//
//   TESSERA_ASSIGN_OR_RETURN(size_t turned, OrientFaces(mesh));
//   TESSERA_ASSIGN_OR_RETURN(MeshInfo info, DescribeMesh(mesh));
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/wang/quad_mesh.h"

namespace tessera {

// Turns faces over until neighbours run against each other along every edge; in each connected component the
// fewer are turned, at a tie those that differ from its first face. Returns how many were turned. A turned
// face keeps its first vertex. Errors: INVALID_ARGUMENT naming the edge that three or more faces share, or
// the edge at which no choice fits because the mesh is not orientable (a Moebius strip).
[[nodiscard]] absl::StatusOr<size_t> OrientFaces(QuadMesh& mesh);

// Doubles every vertex in which faces meet without being connected around it by edges, so that each vertex
// has one fan of faces. Returns the number of vertices added; they are appended. `mesh` and its adjacency
// must fit.
size_t SplitSingularVertices(QuadMesh& mesh, const QuadAdjacency& adjacency);

// Removes vertices that no face refers to, keeping the order of the others. Returns how many.
size_t DropUnreferencedVertices(QuadMesh& mesh);

// Facts for people: `tessera mesh info`, metadata of dressings.
struct MeshInfo {
  size_t num_vertices = 0;  // referenced ones
  size_t num_quads = 0;
  size_t num_edges = 0;
  size_t num_components = 0;
  size_t num_boundary_loops = 0;
  size_t num_boundary_edges = 0;
  size_t num_irregular_vertices = 0;  // inner vertices where other than four quads meet
  size_t genus = 0;                   // handles, summed over the components
  // Edge lengths, in the mesh's units.
  double min_edge = 0.0;
  double median_edge = 0.0;
  double max_edge = 0.0;
  // Quad areas, in square units.
  double min_area = 0.0;
  double median_area = 0.0;
  double max_area = 0.0;
  Eigen::Vector3f box_min = Eigen::Vector3f::Zero();
  Eigen::Vector3f box_max = Eigen::Vector3f::Zero();
};

// Euler's formula per component: V - E + F = 2 - 2 genus - boundary loops. A vertex with several fans counts
// once for each. Errors: as ValidateQuadMesh and BuildAdjacency.
[[nodiscard]] absl::StatusOr<MeshInfo> DescribeMesh(const QuadMesh& mesh);

// Edges of a mesh, each once, in order of the lowest (face, side) that lies on it.
struct MeshEdges {
  std::vector<uint32_t> keys;                    // [edges], 4 face + side of that lowest one
  std::vector<std::array<uint32_t, 4>> edge_of;  // [face][side] -> edge
};
[[nodiscard]] MeshEdges ListEdges(const QuadAdjacency& adjacency);

// Area of a quad: half the length of the cross product of its diagonals.
[[nodiscard]] double QuadArea(const QuadMesh& mesh, size_t face);

}  // namespace tessera
