#include "btf/tiles/pattern.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

TEST(PatternTest, FeaturesOfWavesAreAsLargeAsAWave) {
  for (const double wave : {9.0, 16.0}) {
    Embedding embedding = BumpyEmbedding(96, 80, 3);
    for (int i = 0; i < 4 * 96 * 80; ++i) {
      float* const point = embedding.values.data() + static_cast<size_t>(i) * 3;
      point[0] = static_cast<float>(std::cos(2.0 * std::numbers::pi * (i % 96) / wave));
      point[1] = static_cast<float>(std::cos(2.0 * std::numbers::pi * (i % (96 * 80) / 96) / wave));
      point[2] = 0.0f;
    }
    const auto pattern = MeasurePattern(Exemplar(embedding), RunContext{});
    ASSERT_TRUE(pattern.ok()) << pattern.status();
    // Averaged over directions, waves along both axes fall off more slowly than along one.
    EXPECT_GT(pattern->feature_size, wave);
    EXPECT_LT(pattern->feature_size, 1.6 * wave);
  }
}

TEST(PatternTest, FeaturesGrowWithBlur) {
  double last = 0.0;
  for (const int blurs : {0, 2, 8}) {
    const std::vector<double> noise = SmoothNoise(96, 96, blurs, 7);
    Embedding embedding = BumpyEmbedding(96, 96, 3);
    for (size_t i = 0; i < embedding.values.size(); ++i) {
      embedding.values[i] = i % 3 == 0 ? static_cast<float>(noise[i / 3 % (96 * 96)]) : 0.0f;
    }
    const auto pattern = MeasurePattern(Exemplar(embedding), RunContext{});
    ASSERT_TRUE(pattern.ok()) << pattern.status();
    EXPECT_GT(pattern->feature_size, 1.2 * last);
    last = pattern->feature_size;
  }
}

TEST(PatternTest, AConstantMaterialHasNoFeatures) {
  Embedding embedding = BumpyEmbedding(40, 40, 3);
  std::fill(embedding.values.begin(), embedding.values.end(), 1.0f);
  const auto pattern = MeasurePattern(Exemplar(embedding), RunContext{});
  ASSERT_TRUE(pattern.ok()) << pattern.status();
  EXPECT_EQ(pattern->feature_size, 0.0);
  EXPECT_FALSE(pattern->period);
  EXPECT_EQ(StripHeightFor(*pattern, 40, 40, 64), kSmallestStrip);
}

TEST(PatternTest, StripsAreAsHighAsFeaturesWithinTheirBounds) {
  const auto height = [](double feature_size, int exemplar_side, int tile_size) {
    return StripHeightFor({.feature_size = feature_size}, exemplar_side, 2 * exemplar_side, tile_size);
  };
  EXPECT_EQ(height(12.9, 256, 64), 12);
  EXPECT_EQ(height(13.1, 256, 64), 14);
  EXPECT_EQ(height(2.0, 256, 64), kSmallestStrip);
  EXPECT_EQ(height(30.0, 128, 64), 12) << "a tenth of the exemplar";
  EXPECT_EQ(height(30.0, 1024, 42), 20) << "half a tile, even";
  EXPECT_EQ(height(30.0, 1024, 64), 30);
}

TEST(PatternTest, TilesAreInStepOnlyWhereThePeriodIsToBeKept) {
  const MaterialPattern cloth{.period = Period{.vectors = {{7.1, 7.1}, {-7.1, 7.1}}}};
  EXPECT_EQ(TileSizeFor(cloth, 0, true), 71) << "57 is as near, but less in step";
  EXPECT_EQ(TileSizeFor(cloth, 36, true), 85) << "71 is less than two strips";
  EXPECT_EQ(TileSizeFor(cloth, 0, false), kDefaultTileSize);
  EXPECT_EQ(TileSizeFor({}, 40, true), 80);
  const MaterialPattern never{.period = Period{.vectors = {{0.0, 90.0}, {149.0, 0.0}}}};
  EXPECT_EQ(TileSizeFor(never, 0, true), kDefaultTileSize);
}

}  // namespace
}  // namespace tessera
