// Step 1 of synthesis: the two end samples of every strip, chosen together, and the cuts between those that
// meet.
//
// clang-format off
//        j ^  in          At a corner of a tile, side `in` ends and side `out` starts. Seen with `out` lying
//          | +----+       along the bottom, both cover the h/2 x h/2 square at the vertex; i counts along
//          | |in /|       `out`, j up. A cut from the vertex to the opposite corner of the square parts them.
//          | |  / |       It is pinned: row j = 0 shows `out`, column i = 0 above it shows `in`, the texel at
//          | | /  |       the vertex `out`.
//          | |/out|
//          +-+----+---> i
// clang-format on
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/tiles/candidates.h"
#include "btf/tiles/tile_sides.h"

namespace tessera {

// The cut of one pair that meets.
struct CornerCut {
  CornerPair pair;
  std::vector<uint8_t> in_wins;  // [j][i], h/2 x h/2
  int64_t cost = 0;              // PairCost along the cut
  int vertex_cost = 0;           // that of the vertex texel and the one across side `in`
};

struct Corners {
  int strip_height = 0;
  // By 2 * strip + end: where the sample lies, h/2 wide and h high, in the strip's own frame.
  std::vector<Patch> samples;
  std::vector<CornerCut> cuts;
  // The mean mismatch of the cuts, a texel of their shortest course, in mean steps, and what it costs that
  // samples overlap or stand out.
  double cost = 0.0;

  [[nodiscard]] const Patch& sample(int strip, StripEnd end) const {
    return samples[static_cast<size_t>(2 * strip) + static_cast<size_t>(end)];
  }
  [[nodiscard]] const CornerCut& cut(const CornerPair& pair) const;
};

// Sets of samples, cheapest first, from several random starts, each improved sample by sample: the best
// places for one sample against the mean of all it meets come from a search, the choice among them from the
// true cuts, drawn at first and greedy at the end. Samples less than a strip height apart in the exemplar pay
// dearly for it, so that not one patch serves every corner. Samples given by hand stay where they are.
// Errors: CANCELLED.
absl::StatusOr<std::vector<Corners>> ChooseCorners(const ExemplarSpectra& spectra,
                                                   const Arrangement& arrangement, int strip_height,
                                                   uint64_t seed, const RunContext& context,
                                                   const std::vector<std::optional<Patch>>& by_hand = {});

}  // namespace tessera
