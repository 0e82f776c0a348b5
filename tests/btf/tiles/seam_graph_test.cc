#include "btf/tiles/seam_graph.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

int64_t CostOf(const Canvas& canvas) {
  int64_t cost = 0;
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x) {
      const uint32_t here = canvas.texel(x, y);
      if (x + 1 < canvas.width() && canvas.filled(x, y) && canvas.filled(x + 1, y)) {
        cost += PairCost(canvas.exemplar(), here, canvas.texel(x + 1, y), GridCut::kRight);
      }
      if (y + 1 < canvas.height() && canvas.filled(x, y) && canvas.filled(x, y + 1)) {
        cost += PairCost(canvas.exemplar(), here, canvas.texel(x, y + 1), GridCut::kDown);
      }
    }
  }
  return cost;
}

class SeamRuleTest : public testing::TestWithParam<SeamRule> {};
INSTANTIATE_TEST_SUITE_P(Both, SeamRuleTest, testing::Values(SeamRule::kMismatch, SeamRule::kExcess));

TEST_P(SeamRuleTest, ACostIsZeroWithinAPatchAndSymmetricAcrossASeam) {
  const Exemplar exemplar(BumpyEmbedding(12, 9, 4), GetParam());
  Rng rng(1);
  for (int round = 0; round < 2000; ++round) {
    const uint32_t a =
        PackTexel(static_cast<uint32_t>(rng.NextBelow(108)), static_cast<int>(rng.NextBelow(4)));
    const uint32_t b =
        PackTexel(static_cast<uint32_t>(rng.NextBelow(108)), static_cast<int>(rng.NextBelow(4)));
    const int direction = static_cast<int>(rng.NextBelow(4));
    EXPECT_EQ(PairCost(exemplar, a, b, direction), PairCost(exemplar, b, a, direction ^ 2));
    if (const uint32_t beside = exemplar.Step(a, direction); beside != kNoTexel) {
      EXPECT_EQ(PairCost(exemplar, a, beside, direction), 0);
    }
  }
}

TEST(PairCostTest, ExcessIsWhatASeamStepsBeyondItsPatchesAndSomeOfWhatTheyWouldHaveShown) {
  // Columns 0 0 0 9 9 9 0.. beside each other, then the same shifted by one grey of 1.
  Embedding embedding{
      .width = 12, .height = 1, .dims = 1, .values = {}, .variance = {1.0}, .total_variance = 1.0};
  for (int turn = 0; turn < 4; ++turn) {
    embedding.values.insert(embedding.values.end(), {0, 0, 0, 9, 9, 9, 1, 1, 1, 10, 10, 10});
  }
  const Exemplar mismatch(embedding, SeamRule::kMismatch);
  const Exemplar excess(embedding, SeamRule::kExcess);
  const double unit = kCostPerStep / excess.mean_step();
  // Texels 1 and 8: both patches are flat, the step of 1 shows.
  EXPECT_NEAR(PairCost(mismatch, 1, 8, GridCut::kRight), 2.0 * unit, 1.0);
  EXPECT_NEAR(PairCost(excess, 1, 8, GridCut::kRight), (2.0 + 0.15 * 2.0) * unit, 1.0);
  // Texels 2 and 9: both patches step by 9, the seam by 10.
  EXPECT_NEAR(PairCost(mismatch, 2, 9, GridCut::kRight), 2.0 * unit, 1.0);
  EXPECT_NEAR(PairCost(excess, 2, 9, GridCut::kRight), (2.0 + 0.15 * (std::sqrt(328.0) - 18.0)) * unit, 1.0);
  // Texels 5 and 10: their patches step by 8 and 0, the seam by 1 only.
  EXPECT_NEAR(PairCost(excess, 5, 10, GridCut::kRight),
              0.15 * (std::sqrt(8.0 * 8.0 + 10.0 * 10.0) - 8.0) * unit, 1.0);
  // Texels 2 and 1: nothing steps here, but the edge beyond texel 2 is lost.
  EXPECT_NEAR(PairCost(excess, 2, 1, GridCut::kRight), 0.15 * (std::sqrt(162.0) - 9.0) * unit, 1.0);
}

// A canvas full of old seams, some texels fixed, some empty; every choice of old and new tried. Under
// kExcess, tables of old seams that are not submodular occur.
TEST_P(SeamRuleTest, ACutFindsTheCheapestChoiceWithOldSeams) {
  const Exemplar exemplar(BumpyEmbedding(24, 20, 5), GetParam());
  int num_exact = 0;
  Rng rng(2);
  PatchCutter cutter;
  for (int round = 0; round < 300; ++round) {
    Canvas canvas(exemplar, 6, 5);
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < 6; ++x) {
        // Two patches meet along a ragged line; away from the exemplar's rim, so that tables are submodular.
        const int shift = static_cast<int>(rng.NextBelow(2)) * 7;
        if (rng.NextBelow(8) != 0) {
          canvas.Set(x, y, exemplar.TexelAt(round % 4, 3 + x + shift, 5 + y));
          if (rng.NextBelow(8) == 0) {
            canvas.Fix(x, y);
          }
        }
      }
    }
    const Window window{1, 1, 4, 3};
    const Patch patch{static_cast<int>(rng.NextBelow(4)), 4 + static_cast<int>(rng.NextBelow(8)),
                      4 + static_cast<int>(rng.NextBelow(8))};
    int64_t best = std::numeric_limits<int64_t>::max();
    for (uint32_t choice = 0; choice < (1u << 12); ++choice) {
      Canvas trial = canvas;
      bool allowed = true;
      for (int i = 0; i < 12 && allowed; ++i) {
        const int x = i % 4;
        const int y = i / 4;
        const bool takes_new = (choice >> i & 1u) != 0;
        allowed = takes_new ? !canvas.fixed(1 + x, 1 + y) : canvas.filled(1 + x, 1 + y);
        if (takes_new && allowed) {
          trial.Set(1 + x, 1 + y, exemplar.TexelAt(patch.turn, patch.u + x, patch.v + y));
        }
      }
      if (allowed) {
        best = std::min(best, CostOf(trial));
      }
    }
    const PatchCut cut = cutter.Cut(canvas, window, patch);
    Canvas after = canvas;
    PatchCutter::Apply(window, patch, cut, after);
    if (GetParam() == SeamRule::kMismatch) {
      EXPECT_EQ(cut.num_truncated, 0) << "round " << round;
    }
    if (cut.num_truncated == 0) {
      ++num_exact;
      EXPECT_EQ(cut.cost_change, best - CostOf(canvas)) << "round " << round;
      EXPECT_EQ(CostOf(after), best) << "round " << round;
    }
    EXPECT_GE(cut.cost_change, CostOf(after) - CostOf(canvas)) << "round " << round;
    const PatchCut below = cutter.Cut(canvas, window, patch, cut.cost_change + 1);
    EXPECT_EQ(below.cost_change, cut.cost_change) << "round " << round;
    EXPECT_EQ(below.takes_new, cut.takes_new) << "round " << round;
    const PatchCut none = cutter.Cut(canvas, window, patch, cut.cost_change);
    EXPECT_GE(none.cost_change, cut.cost_change) << "round " << round;
    EXPECT_EQ(none.num_new, 0) << "round " << round;
    EXPECT_EQ(std::ranges::count(none.takes_new, 1), 0) << "round " << round;
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < 6; ++x) {
        if (canvas.fixed(x, y)) {
          EXPECT_EQ(after.texel(x, y), canvas.texel(x, y));
        }
      }
    }
  }
  EXPECT_GT(num_exact, 100);
}

TEST(CanvasTest, KeepsPairCostsWhenTexelsChange) {
  const Exemplar exemplar(BumpyEmbedding(16, 16, 6));
  Canvas canvas(exemplar, 5, 4);
  Rng rng(9);
  for (int round = 0; round < 200; ++round) {
    canvas.Set(
        static_cast<int>(rng.NextBelow(5)), static_cast<int>(rng.NextBelow(4)),
        rng.NextBelow(5) == 0 ? kNoTexel : PackTexel(static_cast<uint32_t>(rng.NextBelow(256)), round % 4));
    ASSERT_EQ(canvas.Measure().cost, CostOf(canvas));
  }
  const auto empty = std::count(canvas.texels().begin(), canvas.texels().end(), kNoTexel);
  EXPECT_EQ(canvas.num_unfilled(), static_cast<int>(empty));
}

}  // namespace
}  // namespace tessera
