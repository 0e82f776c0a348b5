#include "btf/tiles/diamonds.h"

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/reason.h"
#include "btf/base/rng.h"
#include "tests/btf/tiles/legal_pairs.h"
#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

using testing::HasSubstr;

SynthesisParams DiamondTiles(SynthesisMethod method) {
  SynthesisParams params;
  params.tile_size = 24;
  params.strip_height = 8;
  params.method = method;
  params.diamonds.num_draws = 20;
  return params;
}

IndexMaps SynthesizeWith(const Exemplar& exemplar, const char* arrangement, const SynthesisParams& params,
                         int num_threads = 0) {
  RunContext context;
  context.num_threads = num_threads;
  absl::StatusOr<IndexMaps> maps =
      SynthesizeIndexMaps(exemplar, **FindArrangement(arrangement), params, context);
  EXPECT_TRUE(maps.ok()) << maps.status();
  return *std::move(maps);
}

// Two places of the exemplar over one square, as samples lie.
Overlap RandomOverlap(const Exemplar& exemplar, int side, int reach, uint64_t seed) {
  Rng rng(seed);
  Overlap overlap{.side = side, .reach = reach, .out = {}, .in = {}};
  const auto draw = [&](int extent) { return static_cast<int>(rng.NextBelow(extent - side)); };
  const Patch out{0, draw(exemplar.width()), draw(exemplar.height())};
  const Patch in{0, draw(exemplar.width()), draw(exemplar.height())};
  for (int j = 0; j <= side; ++j) {
    for (int i = 0; i <= side; ++i) {
      const auto at = [&](const Patch& patch) {
        return exemplar.TexelAt(patch.turn, patch.u + i, patch.v + side - j);
      };
      overlap.out.push_back(j < side ? at(out) : kNoTexel);
      overlap.in.push_back(i < side ? at(in) : kNoTexel);
    }
  }
  return overlap;
}

// What a choice costs, by its definition: all pairs of the square and those across its far sides.
int64_t CostOf(const Exemplar& exemplar, const Overlap& overlap, const std::vector<uint8_t>& in_wins) {
  const int side = overlap.side;
  const auto shown = [&](int i, int j) {
    const bool is_in = j == side || (i < side && in_wins[static_cast<size_t>(j) * side + i] != 0);
    return (is_in ? overlap.in : overlap.out)[overlap.Index(i, j)];
  };
  int64_t cost = 0;
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      cost += PairCost(exemplar, shown(i, j), shown(i + 1, j), GridCut::kRight);
      cost += PairCost(exemplar, shown(i, j), shown(i, j + 1), GridCut::kUp);
    }
  }
  return cost;
}

// The cheapest of all staircases: for each column where `in` begins, never lower than in the column before.
int64_t CheapestStaircase(const Exemplar& exemplar, const Overlap& overlap, int column,
                          std::vector<int>& begins) {
  const int side = overlap.side;
  if (column == side) {
    std::vector<uint8_t> in_wins(static_cast<size_t>(side) * side, 0);
    for (int i = 0; i < side; ++i) {
      for (int j = begins[i]; j < side; ++j) {
        in_wins[static_cast<size_t>(j) * side + i] = 1;
      }
    }
    return CostOf(exemplar, overlap, in_wins);
  }
  int64_t best = std::numeric_limits<int64_t>::max();
  const int from = column == 0 ? 1 : begins.back();
  const int to = column == 0 ? 1 : side;
  for (int j = from; j <= to; ++j) {
    // Texels outside the reach have no choice.
    if ((column > 0 && j - 1 - column >= overlap.reach) || column - j >= overlap.reach) {
      continue;
    }
    begins.push_back(j);
    best = std::min(best, CheapestStaircase(exemplar, overlap, column + 1, begins));
    begins.pop_back();
  }
  return best;
}

TEST(DiamondCutTest, PathIsTheCheapestStaircaseAndTheMinimumCutAtMostAsDear) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const Exemplar exemplar(BumpyEmbedding(32, 32, seed),
                            seed % 2 == 0 ? SeamRule::kExcess : SeamRule::kMismatch);
    for (const int reach : {3, 6}) {
      const Overlap overlap = RandomOverlap(exemplar, 6, reach, 100 + seed);
      const OverlapCut path = CutByPath(exemplar, overlap);
      const OverlapCut minimum = CutByMinimum(exemplar, overlap);
      std::vector<int> begins;
      EXPECT_EQ(path.cost, CheapestStaircase(exemplar, overlap, 0, begins));
      EXPECT_EQ(path.cost, CostOf(exemplar, overlap, path.in_wins));
      EXPECT_EQ(minimum.cost, CostOf(exemplar, overlap, minimum.in_wins));
      EXPECT_LE(minimum.cost, path.cost);
      for (int j = 0; j < 6; ++j) {
        for (int i = 0; i < 6; ++i) {
          for (const OverlapCut* const cut : {&path, &minimum}) {
            const bool in_wins = cut->in_wins[static_cast<size_t>(j) * 6 + i] != 0;
            if (j == 0 || i - j >= reach) {
              EXPECT_FALSE(in_wins) << i << " " << j;
            } else if (i == 0 || j - i >= reach) {
              EXPECT_TRUE(in_wins) << i << " " << j;
            }
          }
        }
      }
    }
  }
}

TEST(DiamondCutTest, SomeMinimumCutsTurnBack) {
  int num_cheaper = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const Exemplar exemplar(BumpyEmbedding(48, 48, seed), SeamRule::kMismatch);
    const Overlap overlap = RandomOverlap(exemplar, 24, 12, seed);
    const OverlapCut minimum = CutByMinimum(exemplar, overlap);
    EXPECT_EQ(minimum.cost, CostOf(exemplar, overlap, minimum.in_wins));
    num_cheaper += minimum.cost < CutByPath(exemplar, overlap).cost ? 1 : 0;
  }
  EXPECT_GT(num_cheaper, 0);
}

TEST(DiamondsTest, EveryLegalPairAgreesOnTheSharedSample) {
  const Exemplar exemplar(BumpyEmbedding(40, 36, 1));
  for (const SynthesisMethod method : {SynthesisMethod::kDiamondDp, SynthesisMethod::kDiamondCut}) {
    const IndexMaps turned = SynthesizeWith(exemplar, "surface-96", DiamondTiles(method));
    EXPECT_EQ(CheckAllPairs(turned, **FindArrangement("surface-96")), 2 * 96 * 96);
    EXPECT_EQ(std::ranges::count(turned.texels, kNoTexel), 0);
    const IndexMaps unturned = SynthesizeWith(exemplar, "plane-16", DiamondTiles(method));
    EXPECT_EQ(CheckAllPairs(unturned, **FindArrangement("plane-16")), 2 * 2 * 8 * 8);
    EXPECT_TRUE(std::ranges::all_of(unturned.texels, [](uint32_t t) { return TurnsOfTexel(t) == 0; }));
  }
}

TEST(DiamondsTest, SameSeedGivesTheSameTilesForAnyNumberOfThreads) {
  const Exemplar exemplar(BumpyEmbedding(40, 40, 4));
  SynthesisParams params = DiamondTiles(SynthesisMethod::kDiamondCut);
  params.diamonds.num_draws = 50;
  const IndexMaps one = SynthesizeWith(exemplar, "surface-96", params, 1);
  EXPECT_EQ(one.texels, SynthesizeWith(exemplar, "surface-96", params, 2).texels);
  EXPECT_EQ(one.texels, SynthesizeWith(exemplar, "surface-96", params, 8).texels);
  params.seed = 8;
  EXPECT_NE(one.texels, SynthesizeWith(exemplar, "surface-96", params, 2).texels);
}

TEST(DiamondsTest, DrawsAgainUntilTheErrorIsSmallEnough) {
  const Exemplar exemplar(BumpyEmbedding(40, 40, 5));
  SynthesisParams params = DiamondTiles(SynthesisMethod::kDiamondDp);
  params.diamonds.num_draws = 100;
  params.diamonds.largest_error = 1e-9;
  const DiamondReport never = SynthesizeWith(exemplar, "plane-16", params).diamonds;
  EXPECT_EQ(never.num_draws, 100);
  EXPECT_FALSE(never.accepted);
  params.diamonds.largest_error = 100.0;
  const DiamondReport first = SynthesizeWith(exemplar, "plane-16", params).diamonds;
  EXPECT_EQ(first.num_draws, 1);
  EXPECT_TRUE(first.accepted);
  ASSERT_LT(never.overlap_error, first.overlap_error) << "the best of a hundred";
  // A limit between the two takes the first set below it.
  params.diamonds.largest_error = 0.5 * (never.overlap_error + first.overlap_error);
  const DiamondReport some = SynthesizeWith(exemplar, "plane-16", params).diamonds;
  EXPECT_GT(some.num_draws, 1);
  EXPECT_TRUE(some.accepted);
  EXPECT_LT(some.overlap_error, params.diamonds.largest_error);
  params.diamonds.num_draws = some.num_draws - 1;
  const DiamondReport one_less = SynthesizeWith(exemplar, "plane-16", params).diamonds;
  EXPECT_FALSE(one_less.accepted);
  EXPECT_EQ(one_less.num_draws, some.num_draws - 1);
}

TEST(DiamondsTest, StopsWhenAsked) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 7));
  for (const std::string_view stage : {"samples", "tiles"}) {
    std::stop_source stop;
    RunContext context;
    context.stop = stop.get_token();
    context.progress = [&](const Progress& progress) {
      if (progress.stage == stage) {
        stop.request_stop();
      }
    };
    EXPECT_EQ(SynthesizeIndexMaps(exemplar, **FindArrangement("surface-96"),
                                  DiamondTiles(SynthesisMethod::kDiamondDp), context)
                  .status()
                  .code(),
              absl::StatusCode::kCancelled)
        << stage;
  }
}

TEST(DiamondsTest, RefusesSizesNamingTheLimit) {
  SynthesisParams params = DiamondTiles(SynthesisMethod::kDiamondCut);
  params.tile_size = 23;
  EXPECT_THAT(CheckSizes(64, 64, params).message(), HasSubstr("tile size 23: must be even"));
  params.tile_size = 48;
  const absl::Status small = CheckSizes(64, 47, params);
  EXPECT_THAT(small.message(), HasSubstr("64x47"));
  EXPECT_EQ(ReasonOf(small), "MATERIAL_TOO_SMALL");
  EXPECT_TRUE(CheckSizes(48, 48, params).ok());
  params.diamonds.num_draws = 0;
  EXPECT_THAT(CheckSizes(64, 64, params).message(), HasSubstr("0 draws"));
}

TEST(SynthesisMethodTest, NamesAreReadBackAndOthersRefusedByName) {
  for (const SynthesisMethod method : kSynthesisMethods) {
    const absl::StatusOr<SynthesisMethod> parsed = ParseSynthesisMethod(SynthesisMethodName(method));
    ASSERT_TRUE(parsed.ok());
    EXPECT_EQ(*parsed, method);
  }
  EXPECT_EQ(ParseSynthesisMethod("hexagon").status().message(),
            "unknown method \"hexagon\", known: frame, diamond-dp, diamond-cut");
}

}  // namespace
}  // namespace tessera
