#include "btf/metrics/flip.h"

#include <array>
#include <utility>

#include <gtest/gtest.h>

#include "btf/base/rng.h"

namespace tessera {
namespace {

Image Constant(int width, int height, const std::array<float, 3>& rgb) {
  Image image(width, height, 3);
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    image.pixels[i] = rgb[i % 3];
  }
  return image;
}

Image Noise(int width, int height, uint64_t seed, float centre, float reach) {
  Image image(width, height, 3);
  Rng rng(seed);
  for (float& value : image.pixels) {
    value = centre + reach * static_cast<float>(2.0 * rng.NextDouble() - 1.0);
  }
  return image;
}

Image Transposed(const Image& image) {
  Image result(image.height, image.width, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      std::copy_n(image.at(x, y), 3, result.at(y, x));
    }
  }
  return result;
}

// Without features and borders only the colour pipeline counts. Expected values worked out by hand in double
// precision from the published formulas: L*a*b*, Hunt, HyAB^0.7, knee at 0.4 of the largest.
TEST(FlipTest, ConstantColoursMatchHandComputedValues) {
  constexpr double kFloat = 2e-4;
  struct Case {
    std::array<float, 3> a, b;
    double expected;
  };
  for (const Case& c :
       {Case{{0, 0, 0}, {1, 1, 1}, 0.967379}, Case{{0.5F, 0.5F, 0.5F}, {0.4F, 0.4F, 0.4F}, 0.215590},
        Case{{1, 0, 0}, {0, 1, 0}, 0.986661}, Case{{0, 1, 0}, {0, 0, 1}, 1.0},
        Case{{0.2F, 0.3F, 0.4F}, {0.25F, 0.3F, 0.35F}, 0.172217}}) {
    const Image a = Constant(24, 20, c.a);
    const Image b = Constant(24, 20, c.b);
    EXPECT_NEAR(Flip(a, b), c.expected, kFloat);
    EXPECT_NEAR(Flip(b, a), c.expected, kFloat);
  }
}

TEST(FlipTest, IsZeroForTheSameAndSymmetric) {
  const Image a = Noise(40, 30, 1, 0.5F, 0.4F);
  const Image b = Noise(40, 30, 2, 0.5F, 0.4F);
  EXPECT_EQ(Flip(a, a), 0.0);
  EXPECT_DOUBLE_EQ(Flip(a, b), Flip(b, a));
  for (const float value : FlipMap(a, b).pixels) {
    EXPECT_GE(value, 0.0F);
    EXPECT_LE(value, 1.0F);
  }
}

TEST(FlipTest, TreatsRowsAndColumnsAlike) {
  const Image a = Noise(40, 24, 1, 0.5F, 0.4F);
  const Image b = Noise(40, 24, 2, 0.5F, 0.4F);
  EXPECT_NEAR(Flip(a, b), Flip(Transposed(a), Transposed(b)), 1e-6);
}

TEST(FlipTest, GrowsWithTheDifference) {
  const Image a = Constant(48, 48, {0.4F, 0.4F, 0.4F});
  double previous = 0.0;
  for (const float reach : {0.02F, 0.05F, 0.1F, 0.2F, 0.4F}) {
    const double flip = Flip(a, Noise(48, 48, 7, 0.4F, reach));
    EXPECT_GT(flip, previous);
    previous = flip;
  }
}

// Stripes finer than the eye resolves look like their mean (linear light adds up); from near they do not.
TEST(FlipTest, FineStripesVanishFromAfar) {
  Image stripes(64, 64, 3);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      std::fill_n(stripes.at(x, y), 3, x % 2 == 0 ? 0.45F : 0.55F);
    }
  }
  const Image mean = Constant(64, 64, {0.5F, 0.5F, 0.5F});
  const Image far_map = FlipMap(mean, stripes, 120.0);
  const Image near_map = FlipMap(mean, stripes, 8.0);
  // The middle: at the border a stripe is repeated.
  EXPECT_LT(far_map.at(32, 32)[0], 0.01F);
  EXPECT_GT(near_map.at(32, 32)[0], 0.05F);
}

// The feature pipeline can only raise the error: an added line counts for more than the same change of level
// without an edge.
TEST(FlipTest, EdgesRaiseTheError) {
  const Image flat = Constant(64, 64, {0.5F, 0.5F, 0.5F});
  Image half = flat;
  for (int y = 0; y < 64; ++y) {
    for (int x = 32; x < 64; ++x) {
      std::fill_n(half.at(x, y), 3, 0.42F);
    }
  }
  const Image map = FlipMap(flat, half);
  EXPECT_NEAR(map.at(60, 32)[0], Flip(flat, Constant(64, 64, {0.42F, 0.42F, 0.42F})), 1e-3);
  EXPECT_GT(map.at(33, 32)[0], map.at(60, 32)[0]);
}

}  // namespace
}  // namespace tessera
