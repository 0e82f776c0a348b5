#include "btf/tiles/index_maps.h"

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/reason.h"
#include "btf/tiles/tile_sides.h"
#include "btf/wang/dress.h"
#include "btf/wang/neighbour.h"
#include "btf/wang/shapes.h"
#include "tests/btf/tiles/legal_pairs.h"
#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

using testing::HasSubstr;

// Pairs of a '+' and a '-' side of one colour, whatever the tiles.
int NumLegalPairs(const char* arrangement_id) {
  const Arrangement& arrangement = **FindArrangement(arrangement_id);
  std::map<int, std::array<int, 2>> count;
  for (size_t tile = 0; tile < arrangement.codes.size(); ++tile) {
    for (const TileSide& side : arrangement.SidesOf(tile)) {
      ++count[side.colour][static_cast<size_t>(side.sign)];
    }
  }
  int pairs = 0;
  for (const auto& [colour, by_sign] : count) {
    pairs += by_sign[0] * by_sign[1];
  }
  return pairs;
}

SynthesisParams SmallParams() {
  SynthesisParams params;
  params.tile_size = 16;
  params.strip_height = 8;
  params.mean_threshold = 10.0;
  params.texel_threshold = 10.0;
  return params;
}

IndexMaps Synthesize(const Exemplar& exemplar, const char* arrangement, const SynthesisParams& params,
                     int num_threads) {
  RunContext context;
  context.num_threads = num_threads;
  absl::StatusOr<IndexMaps> maps =
      SynthesizeIndexMaps(exemplar, **FindArrangement(arrangement), params, context);
  EXPECT_TRUE(maps.ok()) << maps.status();
  return *std::move(maps);
}

TEST(IndexMapsTest, EveryLegalPairOfSurface96AgreesOnTheSharedStrip) {
  const Exemplar exemplar(BumpyEmbedding(40, 36, 1));
  const IndexMaps maps = Synthesize(exemplar, "surface-96", SmallParams(), 0);
  EXPECT_EQ(CheckAllPairs(maps, **FindArrangement("surface-96")), 2 * 96 * 96);
}

TEST(IndexMapsTest, EveryLegalPairOfPlane16AgreesAndNothingIsTurned) {
  const Exemplar exemplar(BumpyEmbedding(36, 40, 2));
  const IndexMaps maps = Synthesize(exemplar, "plane-16", SmallParams(), 0);
  EXPECT_EQ(CheckAllPairs(maps, **FindArrangement("plane-16")), 2 * 2 * 8 * 8);
  for (const uint32_t texel : maps.texels) {
    ASSERT_EQ(TurnsOfTexel(texel), 0);
  }
  // The vertical strips stand upright: east takes the left half, west the right half of the same h x w
  // picture.
  const Arrangement& arrangement = **FindArrangement("plane-16");
  const Strip& strip = maps.strips[2];  // vertical, colour 0
  for (int tile = 0; tile < 16; ++tile) {
    const TileSides sides = arrangement.SidesOf(tile);
    for (int y = 1; y + 1 < 16; ++y) {
      // Upright picture: column c, row r is the lying strip at x = w - 1 - r, y = c.
      if (sides[1].colour == 0) {
        EXPECT_EQ(maps.texel(tile, 15, y), TurnTexel(strip.texel(15 - y, 3), 1));
      }
      if (sides[3].colour == 0) {
        EXPECT_EQ(maps.texel(tile, 0, y), TurnTexel(strip.texel(15 - y, 4), 1));
      }
    }
  }
}

TEST(IndexMapsTest, EveryLegalPairOfSurface26AgreesTurnedAsDressingsTurnThem) {
  const Exemplar exemplar(BumpyEmbedding(40, 36, 8));
  IndexMaps maps = Synthesize(exemplar, "surface-26", SmallParams(), 0);
  EXPECT_EQ(CheckAllPairs(maps, **FindArrangement("surface-26")), NumLegalPairs("surface-26"));
  maps.texels = Surface96FromSurface26(maps.texels, maps.tile_size);
  EXPECT_EQ(CheckAllPairs(maps, **FindArrangement("surface-96")), 2 * 96 * 96);
}

TEST(IndexMapsTest, EveryLegalPairOfPlane81AgreesAndNothingIsTurned) {
  const Exemplar exemplar(BumpyEmbedding(36, 40, 9));
  const IndexMaps maps = Synthesize(exemplar, "plane-81", SmallParams(), 0);
  EXPECT_EQ(maps.strips.size(), 6u);
  EXPECT_EQ(CheckAllPairs(maps, **FindArrangement("plane-81")), 2 * 3 * 27 * 27);
  EXPECT_TRUE(std::ranges::all_of(maps.texels, [](uint32_t texel) { return TurnsOfTexel(texel) == 0; }));
}

// Walks every edge of a dressed mesh: on either side lies its half of one strip, row against row.
void ExpectMatchedEdges(const IndexMaps& maps, const Arrangement& arrangement, const QuadMesh& mesh) {
  const absl::StatusOr<DressResult> dressed = DressMesh(mesh, arrangement, {}, RunContext{});
  ASSERT_TRUE(dressed.ok()) << dressed.status();
  const Dressing& dressing = dressed->dressing;
  const auto neighbours = *BuildTileNeighbours(dressing);
  const int size = maps.tile_size;
  const auto texel_on = [&](int face, int side, int position) {
    const auto [x, y] = TexelOnSide(side, position, 0, size);
    return maps.texel(static_cast<int>(dressing.tile[face]), x, y);
  };
  for (int face = 0; face < static_cast<int>(neighbours.size()); ++face) {
    const TileSides sides = arrangement.SidesOf(dressing.tile[face]);
    for (int side = 0; side < 4; ++side) {
      const TileNeighbour& across = neighbours[face][side];
      if (across.face < 0 || sides[side].sign != Sign::kPlus) {
        continue;
      }
      const Strip& strip = maps.strips[StripOfSide(arrangement, side, sides[side].colour)];
      for (int x = 1; x + 1 < size; ++x) {
        const uint32_t here = texel_on(face, side, x);
        const uint32_t there = TurnTexel(texel_on(across.face, across.side, size - 1 - x), across.turns);
        ASSERT_EQ(here, TurnTexel(strip.texel(x, strip.height / 2 - 1), side)) << face << " " << side;
        ASSERT_EQ(there, TurnTexel(strip.texel(x, strip.height / 2), side)) << face << " " << side;
      }
    }
  }
}

TEST(IndexMapsTest, DressedMeshesMatchAcrossEveryEdge) {
  const Exemplar exemplar(BumpyEmbedding(36, 36, 12));
  const Arrangement& surface = **FindArrangement("surface-26");
  const IndexMaps turned = Synthesize(exemplar, "surface-26", SmallParams(), 0);
  for (const std::string_view shape : BuiltinShapeNames()) {
    ExpectMatchedEdges(turned, surface, *BuiltinShape(shape));
  }
  const IndexMaps unturned = Synthesize(exemplar, "plane-81", SmallParams(), 0);
  for (const char* const shape : {"plane", "torus"}) {
    ExpectMatchedEdges(unturned, **FindArrangement("plane-81"), *BuiltinShape(shape));
  }
}

TEST(IndexMapsTest, CornerTexelsBelongToTheSideThatStartsThere) {
  const Exemplar exemplar(BumpyEmbedding(40, 40, 3));
  const IndexMaps maps = Synthesize(exemplar, "surface-96", SmallParams(), 0);
  const Arrangement& arrangement = **FindArrangement("surface-96");
  for (int tile = 0; tile < 96; ++tile) {
    const TileSides sides = arrangement.SidesOf(tile);
    for (int side = 0; side < 4; ++side) {
      const auto [x, y] = TilePixelAt(side, 0, 0, 16);
      const StripTexel at = StripTexelAt(side, sides[side].sign, 0, 0, 16, 8);
      EXPECT_EQ(maps.texel(tile, x, y),
                TurnTexel(maps.strips[sides[side].colour].texel(at.x, at.y), at.turns));
    }
  }
}

TEST(IndexMapsTest, SameSeedGivesTheSameTilesForAnyNumberOfThreads) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 4));
  SynthesisParams params = SmallParams();
  params.seed = 7;
  const IndexMaps one = Synthesize(exemplar, "surface-96", params, 1);
  EXPECT_EQ(one.texels, Synthesize(exemplar, "surface-96", params, 2).texels);
  EXPECT_EQ(one.texels, Synthesize(exemplar, "surface-96", params, 8).texels);
  params.seed = 8;
  EXPECT_NE(one.texels, Synthesize(exemplar, "surface-96", params, 2).texels);
}

// On a grid, an inside that two tiles have in common in the same place is seen to come back.
TEST(IndexMapsTest, NoTwoTilesShowTheSameInside) {
  constexpr int kTile = 32;
  constexpr int kMargin = 4;
  constexpr int kInside = (kTile - 2 * kMargin) * (kTile - 2 * kMargin);
  for (const uint64_t seed : {1, 2}) {
    const Exemplar exemplar(BumpyEmbedding(64, 64, 10 + seed));
    SynthesisParams params = SmallParams();
    params.tile_size = kTile;
    params.seed = seed;
    const IndexMaps maps = Synthesize(exemplar, "plane-16", params, 0);
    int num_alike = 0;
    for (int a = 0; a < 16; ++a) {
      for (int b = 0; b < a; ++b) {
        int same = 0;
        for (int y = kMargin; y < kTile - kMargin; ++y) {
          for (int x = kMargin; x < kTile - kMargin; ++x) {
            same += maps.texel(a, x, y) == maps.texel(b, x, y) ? 1 : 0;
          }
        }
        num_alike += same > 0.3 * kInside ? 1 : 0;
      }
    }
    EXPECT_EQ(num_alike, 0) << "of 120 pairs have more than 30% in common, seed " << seed;
  }
}

TEST(IndexMapsTest, NoTileLaidTurnedShowsTheInsideOfAnother) {
  constexpr int kTile = 32;
  constexpr int kMargin = 4;
  constexpr int kInside = (kTile - 2 * kMargin) * (kTile - 2 * kMargin);
  const Exemplar exemplar(BumpyEmbedding(64, 64, 13));
  SynthesisParams params = SmallParams();
  params.tile_size = kTile;
  const IndexMaps maps = Synthesize(exemplar, "surface-26", params, 0);
  int num_alike = 0;
  for (int turns = 0; turns < 4; ++turns) {
    for (int a = 0; a < 26; ++a) {
      const std::vector<uint32_t> turned = TurnedTile(maps, a, turns);
      for (int b = 0; b < a; ++b) {
        int same = 0;
        for (int y = kMargin; y < kTile - kMargin; ++y) {
          for (int x = kMargin; x < kTile - kMargin; ++x) {
            same += turned[y * kTile + x] == maps.texel(b, x, y) ? 1 : 0;
          }
        }
        num_alike += same > 0.3 * kInside ? 1 : 0;
      }
    }
  }
  EXPECT_EQ(num_alike, 0) << "of 1,300 pairs have more than 30% in common";
}

TEST(IndexMapsTest, TakesAnyEvenStripAndAnyTileOfTwiceIt) {
  const Exemplar exemplar(BumpyEmbedding(32, 48, 5));
  for (const auto& [tile, strip] : std::vector<std::array<int, 2>>{{16, 8}, {23, 10}, {33, 16}, {70, 8}}) {
    SynthesisParams params = SmallParams();
    params.tile_size = tile;
    params.strip_height = strip;
    const IndexMaps maps = Synthesize(exemplar, "plane-16", params, 0);
    EXPECT_EQ(CheckAllPairs(maps, **FindArrangement("plane-16")), 256) << tile << " " << strip;
    EXPECT_EQ(std::count(maps.texels.begin(), maps.texels.end(), kNoTexel), 0);
  }
}

TEST(IndexMapsTest, RefusesSizesNamingTheLimit) {
  SynthesisParams params = SmallParams();
  params.strip_height = 7;
  EXPECT_THAT(CheckSizes(64, 64, params).message(), HasSubstr("strip height 7"));
  params.strip_height = 6;
  EXPECT_THAT(CheckSizes(64, 64, params).message(), HasSubstr("at least 8"));
  params.strip_height = 10;
  EXPECT_THAT(CheckSizes(64, 64, params).message(), HasSubstr("tile size 16: must be in [20"));
  params = SmallParams();
  const absl::Status small = CheckSizes(64, 31, params);
  EXPECT_THAT(small.message(), HasSubstr("64x31"));
  EXPECT_EQ(ReasonOf(small), "MATERIAL_TOO_SMALL");
  params = {.tile_size = 128, .strip_height = 40};
  EXPECT_THAT(CheckSizes(79, 128, params).message(), HasSubstr("at least 80x80"));
  EXPECT_TRUE(CheckSizes(80, 80, params).ok());
}

TEST(IndexMapsTest, EffortImprovesWhereSeamsShow) {
  // A slope that nowhere comes back: what has gone up must jump down.
  Embedding embedding{
      .width = 40, .height = 40, .dims = 1, .values = {}, .variance = {1.0}, .total_variance = 1.0};
  for (int i = 0; i < 4 * 40 * 40; ++i) {
    const float x = static_cast<float>(i % 40);
    const float y = static_cast<float>(i / 40 % 40);
    embedding.values.push_back(x + 0.1F * x * y);
  }
  const Exemplar exemplar(embedding);
  SynthesisParams params = SmallParams();
  params.tile_size = 48;
  const auto seams = [&](int effort) {
    params.effort = effort;
    const IndexMaps maps = Synthesize(exemplar, "plane-16", params, 0);
    double sum = 0.0;
    for (const FillReport& report : maps.tile_reports) {
      sum += report.mean_mismatch / 16;
    }
    return sum;
  };
  EXPECT_LT(seams(8), 0.95 * seams(1));
  for (const int effort : {0, kMostEffort + 1}) {
    params.effort = effort;
    EXPECT_THAT(CheckSizes(40, 40, params).message(), HasSubstr("must be in [1, 100]"));
  }
}

TEST(IndexMapsTest, SaysWhichStripMissedItsThresholdAndByHowMuch) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 6));
  SynthesisParams params = SmallParams();
  params.mean_threshold = 1e-3;
  const absl::StatusOr<IndexMaps> maps =
      SynthesizeIndexMaps(exemplar, **FindArrangement("plane-16"), params, RunContext{});
  ASSERT_EQ(maps.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ReasonOf(maps.status()), "THRESHOLD_NOT_REACHED");
  EXPECT_THAT(std::string(maps.status().message()), HasSubstr("strip 0"));
  EXPECT_THAT(std::string(maps.status().message()), HasSubstr("limit 0.00"));
}

TEST(IndexMapsTest, StopsWhenAsked) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 7));
  for (const std::string_view stage : {"corners", "strips", "tiles"}) {
    std::stop_source stop;
    RunContext context;
    context.stop = stop.get_token();
    int after = 0;
    context.progress = [&](const Progress& progress) {
      after += stop.stop_requested() ? 1 : 0;
      if (progress.stage == stage) {
        stop.request_stop();
      }
    };
    EXPECT_EQ(SynthesizeIndexMaps(exemplar, **FindArrangement("surface-96"), SmallParams(), context)
                  .status()
                  .code(),
              absl::StatusCode::kCancelled);
    EXPECT_LE(after, 8) << "only what was under way is finished";
  }
}

}  // namespace
}  // namespace tessera
