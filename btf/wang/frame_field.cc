#include "btf/wang/frame_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "btf/base/rng.h"

namespace tessera {
namespace {

constexpr int kMostSweeps = 200;
constexpr size_t kMostDraws = 1000000;  // in all sweeps of all components
// In broken edges: at the first a domain wall moves freely and does not melt, at the last none is left.
constexpr double kFirstTemperature = 0.8;
constexpr double kLastTemperature = 0.15;

// By turns, across how many sides of a face its frame would go on.
std::array<int, 4> VotesFor(const QuadAdjacency& adjacency, uint32_t face,
                            const std::vector<uint8_t>& turns) {
  std::array<int, 4> votes{};
  for (int side = 0; side < 4; ++side) {
    const QuadAdjacency::Across& across = adjacency.across[face][side];
    if (across.face >= 0) {
      ++votes[ContinuedTurns(turns[across.face], across.side, side)];
    }
  }
  return votes;
}

// Sides at which frames go on, those between two of the faces twice.
int64_t CountContinued(const QuadAdjacency& adjacency, std::span<const uint32_t> faces,
                       const std::vector<uint8_t>& turns) {
  int64_t continued = 0;
  for (const uint32_t face : faces) {
    continued += VotesFor(adjacency, face, turns)[turns[face]];
  }
  return continued;
}

// Turns single faces to the majority of their neighbours until that removes no break.
void Settle(const QuadAdjacency& adjacency, std::span<const uint32_t> faces, std::vector<uint8_t>& turns) {
  // Each turn removes at least one break, so this ends.
  for (bool changed = true; changed;) {
    changed = false;
    for (const uint32_t face : faces) {
      const std::array<int, 4> votes = VotesFor(adjacency, face, turns);
      const auto best = static_cast<uint8_t>(std::ranges::max_element(votes) - votes.begin());
      if (votes[best] > votes[turns[face]]) {
        turns[face] = best;
        changed = true;
      }
    }
  }
}

// Simulated annealing: faces are drawn turned the more likely the more of their neighbours agree, ever more
// so.
void Anneal(const QuadAdjacency& adjacency, std::span<const uint32_t> faces, std::vector<uint8_t>& turns) {
  const size_t num_faces = adjacency.across.size();
  const int num_sweeps = static_cast<int>(std::min<size_t>(kMostSweeps, kMostDraws / num_faces));
  Rng rng(faces.front());
  for (int sweep = 0; sweep < num_sweeps; ++sweep) {
    const double temperature = kFirstTemperature * std::pow(kLastTemperature / kFirstTemperature,
                                                            static_cast<double>(sweep) / num_sweeps);
    std::array<double, 5> weight_of_votes{};
    for (size_t votes = 0; votes < weight_of_votes.size(); ++votes) {
      weight_of_votes[votes] = std::exp(static_cast<double>(votes) / temperature);
    }
    for (const uint32_t face : faces) {
      const std::array<int, 4> votes = VotesFor(adjacency, face, turns);
      double total = 0.0;
      for (const int count : votes) {
        total += weight_of_votes[count];
      }
      double draw = rng.NextDouble() * total;
      uint8_t drawn = 0;
      while (drawn < 3 && draw >= weight_of_votes[votes[drawn]]) {
        draw -= weight_of_votes[votes[drawn++]];
      }
      turns[face] = drawn;
    }
  }
}

// Of one connected component.
void LowerBreaks(const QuadAdjacency& adjacency, std::span<const uint32_t> faces,
                 std::vector<uint8_t>& turns) {
  Settle(adjacency, faces, turns);
  const int64_t settled_continued = CountContinued(adjacency, faces, turns);
  std::vector<uint8_t> settled;
  for (const uint32_t face : faces) {
    settled.push_back(turns[face]);
  }
  Anneal(adjacency, faces, turns);
  Settle(adjacency, faces, turns);
  if (CountContinued(adjacency, faces, turns) <= settled_continued) {
    for (size_t i = 0; i < faces.size(); ++i) {
      turns[faces[i]] = settled[i];
    }
  }
}

}  // namespace

std::vector<uint8_t> ConsistentTurns(const QuadAdjacency& adjacency) {
  const size_t num_faces = adjacency.across.size();
  std::vector<uint8_t> turns(num_faces, 0);
  std::vector<bool> seen(num_faces, false);
  std::vector<uint32_t> component;  // in the order in which faces are reached
  for (uint32_t root = 0; root < num_faces; ++root) {
    if (seen[root]) {
      continue;
    }
    seen[root] = true;
    component.assign(1, root);
    bool is_consistent = true;
    for (size_t i = 0; i < component.size(); ++i) {  // grows while it is worked through
      const uint32_t face = component[i];
      for (int side = 0; side < 4; ++side) {
        const QuadAdjacency::Across& across = adjacency.across[face][side];
        if (across.face < 0) {
          continue;
        }
        const uint8_t continued = ContinuedTurns(turns[face], side, across.side);
        if (!seen[across.face]) {
          seen[across.face] = true;
          turns[across.face] = continued;
          component.push_back(static_cast<uint32_t>(across.face));
        }
        is_consistent = is_consistent && turns[across.face] == continued;
      }
    }
    if (!is_consistent) {
      LowerBreaks(adjacency, component, turns);
    }
  }
  return turns;
}

}  // namespace tessera
