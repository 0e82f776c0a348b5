// A consistently oriented frame on as many quads as possible, for arrangements whose strips are not turned.
//
// Face f laid with r_f quarter turns and its neighbour g with r_g (f's side k against g's side j) have the
// same frame when tile side k - r_f of f is opposite to tile side j - r_g of g:  r_g = r_f + j - k - 2 (mod
// 4). Around a vertex of other than four quads, or a handle with a twist, that cannot hold everywhere.
#pragma once

#include <cstdint>
#include <vector>

#include "btf/wang/quad_mesh.h"

namespace tessera {

// Turns of g that continue face f's frame across f's side k onto g's side j.
[[nodiscard]] constexpr uint8_t ContinuedTurns(uint8_t turns_f, int side_f, int side_g) {
  return static_cast<uint8_t>((turns_f + side_g - side_f + 2) & 3);
}

// [faces], 0..3. In every connected component that has a consistent frame it is found, with 0 turns on the
// lowest face. Elsewhere the frame is spread breadth first from there, then simulated annealing lowers the
// number of edges at which it breaks: near the least possible, not always there. A million draws at most.
[[nodiscard]] std::vector<uint8_t> ConsistentTurns(const QuadAdjacency& adjacency);

}  // namespace tessera
