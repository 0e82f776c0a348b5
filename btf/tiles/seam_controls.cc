#include "btf/tiles/seam_controls.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "btf/base/rng.h"
#include "btf/tiles/border_cut.h"
#include "btf/tiles/seam_graph.h"

namespace tessera {
namespace {

constexpr int kJoins = 128;
constexpr uint64_t kJoinSeed = 1;
constexpr int kJoinHeights = 4;  // of a window, in strip heights

void AddIfCut(const Exemplar& exemplar, uint32_t a, uint32_t b, int direction, Seams& seams) {
  seams.num_pairs += 1.0;
  if (exemplar.Step(a, direction) != b) {
    seams.pairs.push_back({a, b, direction});
  }
}

}  // namespace

Seams FalseCuts(const Exemplar& exemplar, int spacing) {
  Seams seams;
  for (int y = 0; y < exemplar.height(); ++y) {
    for (int x = 0; x < exemplar.width(); ++x) {
      const uint32_t a = exemplar.TexelAt(0, x, y);
      for (const int direction : {GridCut::kRight, GridCut::kDown}) {
        const uint32_t b = exemplar.Step(a, direction);
        if (b != kNoTexel && ((direction == GridCut::kRight ? x : y) + 1) % spacing == 0) {
          seams.pairs.push_back({a, b, direction});
        }
      }
    }
  }
  seams.num_pairs = static_cast<double>(seams.pairs.size());
  return seams;
}

RandomJoins JoinAtRandom(const Exemplar& exemplar, const std::vector<int>& turns, int strip_height) {
  const int shorter = std::min(exemplar.width(), exemplar.height());
  const int width = std::min(strip_height, shorter);
  const int height = std::min(kJoinHeights * strip_height, shorter);
  Rng rng(kJoinSeed);
  RandomJoins joins;
  BorderCut grid;
  for (int join = 0; join < kJoins; ++join) {
    const auto draw = [&] {
      const int turn = turns[rng.NextBelow(turns.size())];
      const auto u = static_cast<int>(rng.NextBelow(exemplar.TurnedWidth(turn) - width + 1));
      const auto v = static_cast<int>(rng.NextBelow(exemplar.TurnedHeight(turn) - height + 1));
      return Patch{turn, u, v};
    };
    const Patch left = draw();
    const Patch right = draw();
    const auto texel = [&](bool is_left, int x, int y) {
      const Patch& patch = is_left ? left : right;
      return exemplar.TexelAt(patch.turn, patch.u + x, patch.v + y);
    };
    // Source side shows the left patch.
    grid.Reset(width, height);
    grid.SetTerminals({{0, height - 1}, {0, 0}}, {{width - 1, 0}, {width - 1, height - 1}});
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const auto set_edge = [&](GridCut::Direction direction, int other_x, int other_y) {
          grid.SetEdge(x, y, direction,
                       PairCost(exemplar, texel(true, x, y), texel(false, other_x, other_y), direction),
                       PairCost(exemplar, texel(false, x, y), texel(true, other_x, other_y), direction));
        };
        if (x + 1 < width) {
          set_edge(GridCut::kRight, x + 1, y);
        }
        if (y + 1 < height) {
          set_edge(GridCut::kDown, x, y + 1);
        }
      }
    }
    grid.Solve();
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const bool here = grid.OnSourceSide(x, y);
        const auto add = [&](int direction, int other_x, int other_y) {
          const bool there = grid.OnSourceSide(other_x, other_y);
          if (here != there) {
            AddIfCut(exemplar, texel(here, x, y), texel(there, other_x, other_y), direction,
                     joins.minimum_cuts);
          }
        };
        if (x + 1 < width) {
          add(GridCut::kRight, x + 1, y);
        }
        if (y + 1 < height) {
          add(GridCut::kDown, x, y + 1);
        }
      }
      AddIfCut(exemplar, texel(true, width / 2 - 1, y), texel(false, width / 2, y), GridCut::kRight,
               joins.straight_cuts);
    }
  }
  return joins;
}

}  // namespace tessera
