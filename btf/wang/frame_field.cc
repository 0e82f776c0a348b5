#include "btf/wang/frame_field.h"

#include <array>

namespace tessera {
namespace {

// Turns a face by the vote of its neighbours; true when that removed a break.
bool TurnToMajority(const QuadAdjacency& adjacency, uint32_t face, std::vector<uint8_t>& turns) {
  std::array<int, 4> votes{};
  for (int side = 0; side < 4; ++side) {
    const QuadAdjacency::Across& across = adjacency.across[face][side];
    if (across.face >= 0) {
      ++votes[ContinuedTurns(turns[across.face], across.side, side)];
    }
  }
  uint8_t best = turns[face];
  for (uint8_t r = 0; r < 4; ++r) {
    if (votes[r] > votes[best]) {
      best = r;
    }
  }
  const bool changed = best != turns[face];
  turns[face] = best;
  return changed;
}

}  // namespace

std::vector<uint8_t> ConsistentTurns(const QuadAdjacency& adjacency) {
  const size_t num_faces = adjacency.across.size();
  std::vector<uint8_t> turns(num_faces, 0);
  std::vector<bool> seen(num_faces, false);
  std::vector<uint32_t> queue;
  queue.reserve(num_faces);
  for (uint32_t root = 0; root < num_faces; ++root) {
    if (seen[root]) {
      continue;
    }
    seen[root] = true;
    queue.push_back(root);
    for (size_t i = queue.size() - 1; i < queue.size(); ++i) {
      const uint32_t face = queue[i];
      for (int side = 0; side < 4; ++side) {
        const QuadAdjacency::Across& across = adjacency.across[face][side];
        if (across.face >= 0 && !seen[across.face]) {
          seen[across.face] = true;
          turns[across.face] = ContinuedTurns(turns[face], side, across.side);
          queue.push_back(static_cast<uint32_t>(across.face));
        }
      }
    }
  }
  // Each turn removes at least one break, so this ends.
  for (bool changed = true; changed;) {
    changed = false;
    for (uint32_t face = 0; face < num_faces; ++face) {
      changed |= TurnToMajority(adjacency, face, turns);
    }
  }
  return turns;
}

}  // namespace tessera
