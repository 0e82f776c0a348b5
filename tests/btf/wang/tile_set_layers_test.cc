#include "btf/wang/tile_set_layers.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Core>

#include "btf/math/conventions.h"

namespace tessera {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(BlockCosinesTest, AreOrthonormalForEverySide) {
  for (const int side : {1, 2, 3, 8, 20}) {
    const BlockCosines transform(side);
    const Eigen::VectorXf image = Eigen::VectorXf::Random(3 * side * side);
    const std::vector<float> cosines = transform.Forward(std::span(image.data(), 3 * side * side));
    EXPECT_NEAR(Eigen::Map<const Eigen::VectorXf>(cosines.data(), 3 * side * side).norm(), image.norm(),
                1e-4F)
        << side;
    const std::vector<float> back = transform.Back(cosines);
    for (int i = 0; i < 3 * side * side; ++i) {
      ASSERT_NEAR(back[i], image[i], 1e-5F) << side;
    }
    // The first cosine of block 1.
    EXPECT_NEAR(cosines[1], image.segment(side * side, side * side).sum() / static_cast<float>(side), 1e-4F)
        << side;
  }
}

TEST(BlockFrequenciesTest, ComeByRisingSum) {
  const std::vector<BlockFrequency> frequencies = BlockFrequencies(4);
  ASSERT_EQ(frequencies.size(), 16u);
  EXPECT_EQ(frequencies[1].u, 1);
  EXPECT_EQ(frequencies[1].v, 0);
  EXPECT_EQ(frequencies[15].u + frequencies[15].v, 6);
}

// Against the means themselves: of a cosine of the block, sampled by BTFels a footprint apart, the largest
// that a texel of the level can be, in between the level and the next.
TEST(LayerBlocksTest, StepsGrowAsWhatIsSeenOfAFrequencyFalls) {
  EXPECT_EQ(LayerBlocks{}.StepFactors(), std::vector<float>{1.0F});
  const LayerBlocks blocks{.side = 16, .footprint = 2, .level = 2};
  const std::vector<BlockFrequency> frequencies = BlockFrequencies(16);
  const std::vector<float> factors = blocks.StepFactors();
  ASSERT_EQ(factors.size(), frequencies.size());
  EXPECT_EQ(factors[0], 2.0F);
  const auto largest = [](const BlockFrequency& at, int count) {  // of the mean of count x count BTFels
    double most = 0.0;
    for (int phase = 0; phase < 64 * 64; ++phase) {
      double sum = 0.0;
      for (int i = 0; i < count * count; ++i) {
        const double x = 2.0 * (i % count) + phase % 64;
        const double y = 2.0 * (i / count) + phase / 64;  // NOLINT(bugprone-integer-division)
        sum += std::cos(kPi * at.u * x / 16.0) * std::cos(kPi * at.v * y / 16.0);
      }
      most = std::max(most, sum / (count * count));
    }
    return most;
  };
  for (size_t f = 0; f < factors.size(); ++f) {
    const BlockFrequency at = frequencies[f];
    if (at.u <= 3 && at.v <= 3) {
      EXPECT_NEAR(2.0 / factors[f], 0.5 * (largest(at, 2) + largest(at, 4)), 0.05) << at.u << " " << at.v;
    }
    EXPECT_GE(factors[f], 2.0F);
    EXPECT_LE(factors[f], 2.0F / static_cast<float>(kLeastSeen));
  }
}

// An exemplar of 5 pixels a row in blocks of 2x2, three to a row: pixels 0, 1, 6 lie in block 0, pixel 14 in
// block 5, pixel 20 in block 6.
TEST(LayerBlocksTest, AreThoseThatBtfelsLieIn) {
  const LayerBlocks blocks = BlocksOf(std::vector<uint32_t>{0, 1, 6, 14, 20}, {.width = 5}, 2, 0);
  EXPECT_THAT(blocks.numbers, ElementsAre(0, 5, 6));
  EXPECT_THAT(blocks.places, ElementsAre(0, 1, 3, 4, 8));
  EXPECT_EQ(blocks.num_pixels(), 12u);
}

// Two blocks of 2x2 BTFels, three coefficients, of which layers make 0 and 2; layer 0 brings one component.
TileSetLayer FirstLayer() {
  TileSetLayer layer{.step = 0.5F, .basis_step = {0.25F}, .basis = {4, -8}};
  layer.codes = {6, 2, 0, 1, 0, 0, 0, 0};  // [frequency][block]
  return layer;
}
LayerBlocks TwoBlocks() {
  std::vector<uint32_t> places(8);
  std::iota(places.begin(), places.end(), 0U);
  return {.side = 2, .numbers = {0, 1}, .places = std::move(places)};
}
LayerSum SumOfNothing() {
  return {TwoBlocks(), {0, 2}, {1.0F, 10.0F, 100.0F}, {1.0F, 1.0F, 2.0F}};
}

TEST(LayerSumTest, IsMeanAndBasisTimesImages) {
  LayerSum sum = SumOfNothing();
  ASSERT_TRUE(sum.Add(FirstLayer()).ok());
  std::vector<uint32_t> btfels(8);
  std::iota(btfels.begin(), btfels.end(), 0u);
  const std::vector<float> values = sum.Coefficients(btfels);
  // Block 0: a constant of 6 * 0.5 / 2. Block 1: 2 * 0.5 / 2, and a cosine across of 1 * 0.5 times the
  // factor: of frequency 1/4, half of which the next level sees as cos(pi/4).
  const float wave = 0.25F * 2.0F / (1.0F + std::sqrt(0.5F));
  const std::vector<float> image = {1.5F,        1.5F,        1.5F,        1.5F,
                                    0.5F + wave, 0.5F - wave, 0.5F + wave, 0.5F - wave};
  for (int btfel = 0; btfel < 8; ++btfel) {
    EXPECT_NEAR(values[3 * btfel + 0], 1.0F + 1.0F * image[btfel], 1e-5F) << btfel;
    EXPECT_EQ(values[3 * btfel + 1], 10.0F);
    EXPECT_NEAR(values[3 * btfel + 2], 100.0F - 4.0F * image[btfel], 1e-5F) << btfel;
  }
  // A second layer makes the image finer, and brings a component of coefficient 2 alone.
  TileSetLayer second{.step = 0.125F, .basis_step = {1.0F}, .basis = {0, 1}};
  second.codes.assign(16, 0);
  second.codes[0] = -1;
  second.codes[8] = 16;
  ASSERT_TRUE(sum.Add(second).ok());
  const std::vector<float> finer = sum.Coefficients(btfels);
  EXPECT_NEAR(finer[3 * 3 + 0], 1.0F + 1.5F - 0.0625F, 1e-6F);
  EXPECT_EQ(finer[3 * 3 + 1], 10.0F);
  EXPECT_NEAR(finer[3 * 3 + 2], 100.0F - 4.0F * (1.5F - 0.0625F) + 2.0F, 1e-5F);
  EXPECT_NEAR(finer[3 * 4 + 2], 100.0F - 4.0F * image[4], 1e-5F);
  // Means of the BTFels of a block.
  const std::vector<float> means = sum.Coefficients(btfels, 4);
  ASSERT_EQ(means.size(), 6u);
  EXPECT_NEAR(means[3 + 0], 1.5F, 1e-5F);
  EXPECT_GE(sum.Bound(), *std::ranges::max_element(finer));
  EXPECT_LE(sum.Bound(), 120.0F);
}

TEST(LayerSumTest, RefusesWhatDoesNotFitAndStaysWhatItWas) {
  LayerSum sum = SumOfNothing();
  ASSERT_TRUE(sum.Add(FirstLayer()).ok());
  TileSetLayer next{.step = 0.1F};
  next.codes.assign(8, 3);
  const auto refused = [&](const auto& change, const char* what) {
    TileSetLayer layer = next;
    change(layer);
    const absl::Status status = sum.Add(layer);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << what;
    EXPECT_THAT(status.message(), HasSubstr(what));
    EXPECT_EQ(sum.num_components(), 1u);
  };
  refused([](TileSetLayer& layer) { layer.step = 0.0F; }, "step 0");
  refused([](TileSetLayer& layer) { layer.step = std::numeric_limits<float>::quiet_NaN(); }, "step nan");
  refused([](TileSetLayer& layer) { layer.basis_step = {-1.0F}; }, "basis_step");
  refused([](TileSetLayer& layer) { layer.basis_step = {1.0F}; }, "0 of 2");
  refused([](TileSetLayer& layer) { layer.codes.pop_back(); }, "7 of 8");
  refused([](TileSetLayer& layer) { layer.basis = {1}; }, "1 of 0");
  refused([](TileSetLayer& layer) { layer.basis_step.assign(kMostLayerComponents, 0.0F); },
          "257 in all of 8 pixels, at most 256");
  EXPECT_TRUE(sum.Add(next).ok());
}

}  // namespace
}  // namespace tessera
