// Signs of all sides by Euler circuits of the dual graph, and colours by hash.
//
// The dual graph has a node for each quad and an edge for each edge of the mesh. Every node has four edges,
// so the graph falls into closed trails. Walking a trail, the side by which a quad is left gets '+' and the
// side by which the next is entered '-': every edge then has one side of each sign, and every quad two of
// each. Open boundaries: a mesh has an even number of boundary edges (4 Q = 2 inner + boundary), so they are
// paired in order of their keys, each pair through one virtual neighbour that a trail enters and leaves.
// Sources: [Fu2005] 3; [Leung2007] 4.1.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "btf/wang/arrangement.h"
#include "btf/wang/mesh_topology.h"
#include "btf/wang/quad_mesh.h"

namespace tessera {

// [face][side]. The side by which a trail goes on is picked among the unused ones by Mix64, so that the six
// sign patterns are about equally frequent and all of a set's tiles are used. Linear time.
[[nodiscard]] std::vector<std::array<Sign, 4>> EulerSigns(const QuadAdjacency& adjacency, uint64_t seed);

// The colour of an edge: Mix64(seed, key) mod num_colours, key = 4 face + side of its lowest (face, side).
[[nodiscard]] int EdgeColour(uint64_t seed, uint32_t edge_key, int num_colours);

}  // namespace tessera
