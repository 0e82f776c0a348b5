// One step of Catmull-Clark subdivision of a closed quad mesh.
//
//   mesh = CatmullClark(mesh);   // four times the quads, smooth in the limit
#pragma once

#include "btf/wang/quad_mesh.h"

namespace tessera {

// Every quad becomes four: face points, edge points and moved vertices,
//   vertex' = (F + 2 E + (n - 3) P) / n,  F mean of face points, E mean of edge midpoints, n the valence.
// The mesh must be valid, closed, oriented and have one fan of faces at each vertex; `normals` are
// recomputed. Source: [Catmull1978].
[[nodiscard]] QuadMesh CatmullClark(const QuadMesh& mesh, const QuadAdjacency& adjacency);

}  // namespace tessera
