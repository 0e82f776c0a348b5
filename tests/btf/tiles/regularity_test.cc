#include "btf/tiles/regularity.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "btf/tiles/index_maps.h"
#include "btf/tiles/repetition.h"
#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

// value(x, y) and a little noise, the same in every turn.
template <typename Value>
Exemplar MadeOf(int width, int height, const Value& value) {
  const std::vector<double> noise = SmoothNoise(width, height, 0, 5);
  Embedding embedding{
      .width = width, .height = height, .dims = 1, .values = {}, .variance = {1.0}, .total_variance = 1.0};
  for (int i = 0; i < 4 * width * height; ++i) {
    const int pixel = i % (width * height);
    embedding.values.push_back(static_cast<float>(value(pixel % width, pixel / width) + 0.3 * noise[pixel]));
  }
  return Exemplar(embedding);
}

double Wave(double x, double length) {
  return std::cos(2.0 * std::numbers::pi * x / length);
}

std::optional<Period> PeriodOf(const Exemplar& exemplar) {
  const auto autocorrelation = Autocorrelation::Of(FieldOfExemplar(exemplar), exemplar.search_dims(), 1,
                                                   exemplar.width() / 2, exemplar.height() / 2, RunContext{});
  EXPECT_TRUE(autocorrelation.ok()) << autocorrelation.status();
  return FindPeriod(*autocorrelation);
}

TEST(RegularityTest, FindsPeriodsOfLessThanATexelsPrecision) {
  // A product of waves repeats after half of both.
  const Exemplar exemplar = MadeOf(120, 100, [](int x, int y) { return Wave(x, 14.6) * Wave(y, 11.4); });
  const std::optional<Period> period = PeriodOf(exemplar);
  ASSERT_TRUE(period);
  ASSERT_EQ(period->vectors.size(), 2u);
  for (const PeriodVector& vector : period->vectors) {
    EXPECT_NEAR(std::abs(vector[0]), 7.3, 0.1);
    EXPECT_NEAR(std::abs(vector[1]), 5.7, 0.1);
  }
  EXPECT_NEAR(PeriodSlip(*period, 146), std::abs(146.0 - 13 * 11.4), 1.5);
}

TEST(RegularityTest, StripesRepeatInOneDirection) {
  const std::optional<Period> period =
      PeriodOf(MadeOf(96, 96, [](int x, int y) { return Wave(x * 0.8 + y * 0.6, 9.0); }));
  ASSERT_TRUE(period);
  ASSERT_EQ(period->vectors.size(), 1u);
  EXPECT_NEAR(std::hypot(period->vectors[0][0], period->vectors[0][1]), 9.0, 0.3);
  // Along x the stripes return after 9 / 0.8, along y after 9 / 0.6 texels.
  EXPECT_LT(PeriodSlip(*period, 45), LargestSlip(*period));
  EXPECT_GT(PeriodSlip(*period, 38), LargestSlip(*period));
}

TEST(RegularityTest, NoiseHasNone) {
  EXPECT_FALSE(PeriodOf(Exemplar(BumpyEmbedding(96, 96, 3))));
  EXPECT_FALSE(PeriodOf(MadeOf(64, 64, [](int, int) { return 0.0; })));
}

TEST(RegularityTest, TileSizesAreInStepAlongBothAxes) {
  const Period cloth{.vectors = {{7.1, 7.1}, {-7.1, 7.1}}};
  EXPECT_NEAR(PeriodSlip(cloth, 57), 0.2, 1e-9);
  EXPECT_NEAR(PeriodSlip(cloth, 64), 7.0, 0.2) << "nine half steps";
  EXPECT_EQ(TileSizeInStep(cloth, 60, 16, 128), 57);
  EXPECT_EQ(TileSizeInStep(cloth, 60, 58, 128), 71);
  EXPECT_FALSE(TileSizeInStep(cloth, 64, 60, 68));
  const Period slab{.vectors = {{0.0, 8.0}, {20.0, 0.0}}};
  EXPECT_EQ(TileSizeInStep(slab, 64, 16, 256), 80) << "8 and 20 meet at 40 and 80";
}

TEST(RegularityTest, TilesInStepKeepThePeriodAndOthersDoNot) {
  const Exemplar quilt = MadeOf(72, 72, [](int x, int y) { return Wave(x, 12.0) + 0.8 * Wave(y, 12.0); });
  ASSERT_TRUE(PeriodOf(quilt));
  const Arrangement& plane = **FindArrangement("plane-16");
  const auto kept = [&](int tile_size) {
    SynthesisParams params;
    params.tile_size = tile_size;
    params.strip_height = 8;
    params.num_candidates = 8;
    params.force = true;
    const auto maps = SynthesizeIndexMaps(quilt, plane, params, RunContext{});
    EXPECT_TRUE(maps.ok()) << maps.status();
    const auto figures = MeasureRepetition(quilt, plane, *maps, params.strip_height, RunContext{});
    EXPECT_TRUE(figures.ok()) << figures.status();
    return (*figures)["period"]["kept"].get<double>();
  };
  EXPECT_GT(kept(24), 0.9);
  EXPECT_LT(kept(30), 0.6);
}

}  // namespace
}  // namespace tessera
