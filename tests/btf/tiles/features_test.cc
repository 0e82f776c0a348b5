#include "btf/tiles/features.h"

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/tiles/index_maps.h"
#include "btf/tiles/tile_sides.h"
#include "tests/btf/tiles/disc_exemplar.h"
#include "tests/btf/tiles/legal_pairs.h"

namespace tessera {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr int kTile = 32;
constexpr int kStrip = 12;
constexpr int kFieldWidth = 60;
constexpr int kFieldHeight = 52;
constexpr char kTwoFeatures[] = R"("features": [
    {"name": "disc", "rectangle": [10, 10, 13, 13], "only_placed": true},
    {"name": "spot", "seeds": {"feature": [[[44, 40]]]}}])";

const Embedding& TestEmbedding() {
  static const Embedding embedding =
      DiscEmbedding(kFieldWidth, kFieldHeight, 5, {{16.0, 16.0, 3.6}, {44.0, 40.0, 2.2}});
  return embedding;
}

SynthesisParams TestParams() {
  SynthesisParams params;
  params.tile_size = kTile;
  params.strip_height = kStrip;
  params.force = true;
  return params;
}

Recipe MakeRecipe(const std::string& rest) {
  const auto recipe = ParseRecipe(std::string("{") + kTwoFeatures + (rest.empty() ? "" : ", " + rest) + "}");
  EXPECT_TRUE(recipe.ok()) << recipe.status();
  return *recipe;
}

absl::StatusOr<Controls> ControlsOf(const Recipe& recipe, const Exemplar& exemplar, const char* arrangement) {
  const auto features = ExtractFeatures(TestEmbedding(), recipe);
  EXPECT_TRUE(features.ok()) << features.status();
  return MakeControls(recipe, *features, exemplar, **FindArrangement(arrangement), kTile, kStrip);
}

std::string RefusalOf(const std::string& rest, const char* arrangement) {
  const Exemplar exemplar(TestEmbedding());
  return std::string(ControlsOf(MakeRecipe(rest), exemplar, arrangement).status().message());
}

IndexMaps SynthesizeControlled(const Exemplar& exemplar, const char* arrangement, const Controls& controls,
                               int threads) {
  RunContext context;
  context.num_threads = threads;
  absl::StatusOr<IndexMaps> maps =
      SynthesizeIndexMaps(exemplar, **FindArrangement(arrangement), TestParams(), context, controls);
  EXPECT_TRUE(maps.ok()) << maps.status();
  return *std::move(maps);
}

TEST(FeaturesTest, KnowTheirBoxAndNumberOfTexels) {
  const auto features = ExtractFeatures(TestEmbedding(), MakeRecipe(""));
  ASSERT_TRUE(features.ok()) << features.status();
  const Feature& disc = (*features)[0];
  EXPECT_EQ(disc.name, "disc");
  EXPECT_TRUE(disc.only_placed);
  EXPECT_EQ(disc.box.x, 13);
  EXPECT_EQ(disc.box.y, 13);
  EXPECT_EQ(disc.box.width, 7);
  EXPECT_EQ(disc.box.height, 7);
  EXPECT_EQ(disc.num_texels, 37);
  EXPECT_EQ(std::count(disc.mask.begin(), disc.mask.end(), 1), 37);
}

// Whether the tile, in the frame of side k and turned by `sign`, shows texel (x, y) of a strip and has it.
void ExpectStripTexel(const IndexMaps& maps, int tile, int side, Sign sign, int x, int y, uint32_t texel) {
  const bool is_plus = sign == Sign::kPlus;
  const int along = is_plus ? x : kTile - 1 - x;
  const int depth = is_plus ? kStrip / 2 - 1 - y : y - kStrip / 2;
  if (depth < 0) {
    return;
  }
  const auto [tile_x, tile_y] = TilePixelAt(side, along, depth, kTile);
  const int turns = is_plus ? side : side + 2;
  ASSERT_EQ(maps.texel(tile, tile_x, tile_y), TurnTexel(texel, turns))
      << "tile " << tile << ", side " << side;
}

// A feature across the edge of horizontal colour 0, one across vertical colour 1, one inside a tile: every
// tile has every texel of them, so both sides of the edges do, and none is anywhere else.
TEST(FeaturesTest, PlacedFeaturesSurviveInPlane16) {
  const Recipe recipe = MakeRecipe(R"("placements": [
      {"feature": "disc", "strip": {"orientation": "horizontal", "colour": 0}, "position": [12, 2]},
      {"feature": "disc", "strip": {"orientation": "vertical", "colour": 1}, "position": [3, 9]},
      {"feature": "disc", "tile": 165, "position": [14, 11]}])");
  const Exemplar exemplar(TestEmbedding());
  const auto controls = ControlsOf(recipe, exemplar, "plane-16");
  ASSERT_TRUE(controls.ok()) << controls.status();
  const IndexMaps maps = SynthesizeControlled(exemplar, "plane-16", *controls, 2);
  EXPECT_EQ(maps.texels, SynthesizeControlled(exemplar, "plane-16", *controls, 1).texels);
  const Arrangement& arrangement = **FindArrangement("plane-16");
  EXPECT_EQ(CheckAllPairs(maps, arrangement), 2 * 2 * 8 * 8);

  const Feature disc = (*ExtractFeatures(TestEmbedding(), recipe))[0];
  std::set<std::pair<int, int>> expected;  // tile, texel of it
  for (int pixel = 0; pixel < kFieldWidth * kFieldHeight; ++pixel) {
    if (disc.mask[pixel] == 0) {
      continue;
    }
    const int x = pixel % kFieldWidth - disc.box.x;
    const int y = pixel / kFieldWidth - disc.box.y;
    for (int tile = 0; tile < 16; ++tile) {
      const TileSides sides = arrangement.SidesOf(tile);
      const auto expect_at = [&](int tile_x, int tile_y) {
        ASSERT_EQ(maps.texel(tile, tile_x, tile_y), static_cast<uint32_t>(pixel)) << "tile " << tile;
        expected.insert({tile, tile_y * kTile + tile_x});
      };
      // The strip lies across the bottom of one tile, rows 0 to 5 of it, and the top of the other.
      const int strip_y = 2 + y;
      if (sides[0].colour == 0 && strip_y < kStrip / 2) {
        expect_at(12 + x, kTile - kStrip / 2 + strip_y);
      }
      if (sides[2].colour == 0 && strip_y >= kStrip / 2) {
        expect_at(12 + x, strip_y - kStrip / 2);
      }
      const int strip_x = 3 + x;
      if (sides[1].colour == 1 && strip_x < kStrip / 2) {
        expect_at(kTile - kStrip / 2 + strip_x, 9 + y);
      }
      if (sides[3].colour == 1 && strip_x >= kStrip / 2) {
        expect_at(strip_x - kStrip / 2, 9 + y);
      }
      if (arrangement.codes[tile] == 165) {
        expect_at(14 + x, 11 + y);
      }
    }
  }
  EXPECT_EQ(expected.size(), 37u * (8 + 8 + 1));
  for (int tile = 0; tile < 16; ++tile) {
    for (int i = 0; i < kTile * kTile; ++i) {
      if (disc.mask[BtfelOfTexel(maps.texel(tile, i % kTile, i / kTile))] != 0) {
        ASSERT_TRUE(expected.contains({tile, i}))
            << "tile " << tile << ", texel " << i << " holds the feature";
      }
    }
  }
}

TEST(FeaturesTest, PlacedFeaturesSurviveTurnedOnEverySideOfSurface96) {
  const Recipe recipe = MakeRecipe(R"("placements": [
      {"feature": "disc", "strip": {"colour": 1}, "position": [10, 3], "turn": 1},
      {"feature": "spot", "strip": {"colour": 1}, "position": [19, 6], "turn": 2},
      {"feature": "spot", "tile": 165, "position": [14, 14], "turn": 3}])");
  const Exemplar exemplar(TestEmbedding());
  const auto controls = ControlsOf(recipe, exemplar, "surface-96");
  ASSERT_TRUE(controls.ok()) << controls.status();
  const IndexMaps maps = SynthesizeControlled(exemplar, "surface-96", *controls, 0);
  const Arrangement& arrangement = **FindArrangement("surface-96");
  CheckAllPairs(maps, arrangement);
  const std::vector<Feature> features = *ExtractFeatures(TestEmbedding(), recipe);
  for (int tile = 0; tile < 96; ++tile) {
    const TileSides sides = arrangement.SidesOf(tile);
    for (int pixel = 0; pixel < kFieldWidth * kFieldHeight; ++pixel) {
      for (int side = 0; side < 4; ++side) {
        if (sides[side].colour != 1) {
          continue;
        }
        const auto on_strip = [&](const Feature& feature, int x, int y, int turn) {
          const int dx = pixel % kFieldWidth - feature.box.x;
          const int dy = pixel / kFieldWidth - feature.box.y;
          const int last_x = feature.box.width - 1;
          const int last_y = feature.box.height - 1;
          if (feature.mask[pixel] != 0) {
            // Counter-clockwise turns of a picture take (dx, dy) to (dy, last_x - dx), then to both mirrored.
            ExpectStripTexel(maps, tile, side, sides[side].sign, x + (turn == 1 ? dy : last_x - dx),
                             y + (turn == 1 ? last_x - dx : last_y - dy), PackTexel(pixel, turn));
          }
        };
        on_strip(features[0], 10, 3, 1);
        on_strip(features[1], 19, 6, 2);
      }
      if (arrangement.codes[tile] == 165 && features[1].mask[pixel] != 0) {
        const Window& box = features[1].box;
        const int x = 14 + box.height - 1 - (pixel / kFieldWidth - box.y);
        const int y = 14 + pixel % kFieldWidth - box.x;
        ASSERT_EQ(maps.texel(tile, x, y), PackTexel(pixel, 3));
      }
    }
  }
}

TEST(FeaturesTest, CornerSamplesGivenByHandAreUsed) {
  const Recipe recipe = MakeRecipe(R"("corners": [
      {"strip": {"orientation": "horizontal", "colour": 1}, "end": "start", "position": [31, 3]},
      {"strip": {"orientation": "vertical", "colour": 0}, "end": "end", "position": [20, 40]}])");
  const Exemplar exemplar(TestEmbedding());
  const auto controls = ControlsOf(recipe, exemplar, "plane-16");
  ASSERT_TRUE(controls.ok()) << controls.status();
  const IndexMaps maps = SynthesizeControlled(exemplar, "plane-16", *controls, 2);
  for (int y = 0; y < kStrip; ++y) {
    for (int x = 0; x < kStrip / 2; ++x) {
      ASSERT_EQ(maps.strips[1].texel(x, y), exemplar.TexelAt(0, 31 + x, 3 + y));
    }
  }
  // The strip stands upright and runs upwards: its end is the top of it, 12 wide and 6 high.
  for (int row = 0; row < kStrip / 2; ++row) {
    for (int column = 0; column < kStrip; ++column) {
      ASSERT_EQ(TurnTexel(maps.strips[2].texel(kTile - 1 - row, column), 1),
                exemplar.TexelAt(0, 20 + column, 40 + row));
    }
  }
}

TEST(FeaturesTest, NoRecipeAndAnEmptyOneGiveTheSameTiles) {
  const Exemplar exemplar(TestEmbedding());
  const auto controls =
      MakeControls(*ParseRecipe("{}"), {}, exemplar, **FindArrangement("plane-16"), kTile, kStrip);
  ASSERT_TRUE(controls.ok()) << controls.status();
  EXPECT_EQ(SynthesizeControlled(exemplar, "plane-16", *controls, 2).texels,
            SynthesizeControlled(exemplar, "plane-16", {}, 2).texels);
}

TEST(FeaturesTest, WhatDoesNotFitIsRefusedWithItsFigures) {
  EXPECT_EQ(
      RefusalOf(R"("placements": [{"feature": "disc", "strip": {"orientation": "horizontal", "colour": 0},
                                         "position": [5, 2]}])",
                "plane-16"),
      "placements[0].position: feature \"disc\" would cover columns 5 to 11, rows 2 to 8; between its corner "
      "samples the strip has columns 6 to 25, rows 0 to 11");
  EXPECT_EQ(RefusalOf(R"("placements": [{"feature": "disc", "strip": {"orientation": "vertical", "colour": 0},
                                         "position": [3, 20]}])",
                      "plane-16"),
            "placements[0].position: feature \"disc\" would cover columns 3 to 9, rows 20 to 26; between its "
            "corner "
            "samples the strip has columns 0 to 11, rows 6 to 25");
  EXPECT_EQ(
      RefusalOf(R"("placements": [{"feature": "disc", "tile": 160, "position": [0, 20]}])", "plane-16"),
      "placements[0].position: feature \"disc\" would cover columns 0 to 6, rows 20 to 26; the inside of the "
      "tile has columns 1 to 30, rows 1 to 30");
  EXPECT_THAT(RefusalOf(R"("placements": [{"feature": "disc", "tile": 160, "position": [9, 9]},
                                          {"feature": "spot", "tile": 165, "position": [9, 9]},
                                          {"feature": "spot", "tile": 160, "position": [12, 9]}])",
                        "plane-16"),
              testing::MatchesRegex("placements\\[2\\].position: [0-9]+ texels of tile 160 are taken by "
                                    "placements\\[0\\]"));
  EXPECT_THAT(RefusalOf(R"("placements": [
                  {"feature": "disc", "strip": {"orientation": "horizontal", "colour": 0}, "position": [12, 2]},
                  {"feature": "disc", "tile": 160, "position": [12, 24]}])",
                        "plane-16"),
              HasSubstr("placements[1].position: "));
  EXPECT_EQ(RefusalOf(R"("corners": [{"strip": {"orientation": "vertical", "colour": 0}, "end": "end",
                                      "position": [49, 3]}])",
                      "plane-16"),
            "corners[0].position: the sample, 12x6 texels at [49, 3], is not inside the exemplar, 60x52");
  EXPECT_THAT(RefusalOf(R"("corners": [{"strip": {"orientation": "horizontal", "colour": 0}, "end": "end",
                                        "position": [12, 10]}])",
                        "plane-16"),
              HasSubstr("texels of feature \"disc\", which is only_placed"));
}

TEST(FeaturesTest, AFeatureThatLeavesNothingForSynthesisIsRefused) {
  Controls controls;
  controls.excluded.assign(size_t{kFieldWidth} * kFieldHeight, 0);
  for (int y = 20; y < kFieldHeight; y += 20) {
    for (int x = 20; x < kFieldWidth; x += 20) {
      controls.excluded[y * kFieldWidth + x] = 1;
    }
  }
  const Exemplar exemplar(TestEmbedding());
  const auto maps =
      SynthesizeIndexMaps(exemplar, **FindArrangement("plane-16"), TestParams(), RunContext{}, controls);
  EXPECT_THAT(std::string(maps.status().message()), HasSubstr("leave no 30x30 texels of the 60x52 exemplar"));
}

TEST(FeaturesTest, SegmentationErrorsNameTheFeature) {
  const auto recipe = ParseRecipe(R"({"features": [{"name": "far", "rectangle": [50, 50, 40, 40]}]})");
  EXPECT_THAT(std::string(ExtractFeatures(TestEmbedding(), *recipe).status().message()),
              StartsWith("features[0] (\"far\"): rectangle 40x40 at (50, 50): not inside"));
}

}  // namespace
}  // namespace tessera
