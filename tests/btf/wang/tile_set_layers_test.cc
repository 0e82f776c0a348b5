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

TEST(BlockFrequenciesTest, ComeByRisingSumAndTheUpperHalfIsCoarser) {
  const std::vector<BlockFrequency> frequencies = BlockFrequencies(4);
  ASSERT_EQ(frequencies.size(), 16u);
  EXPECT_EQ(frequencies[1].u, 1);
  EXPECT_EQ(frequencies[1].v, 0);
  EXPECT_EQ(frequencies[15].u + frequencies[15].v, 6);
  EXPECT_EQ(StepFactor({1, 1}, 4), 1.0F);
  EXPECT_EQ(StepFactor({0, 2}, 4), 2.0F);
  EXPECT_EQ(StepFactor({0, 0}, 1), 1.0F);
}

// Two blocks of 2x2 BTFels, three coefficients, of which layer 0 brings 0 and 2 by one component.
TileSetLayer FirstLayer() {
  TileSetLayer layer{
      .step = 0.5F, .coefficients = {0, 2}, .spans = {0}, .basis_step = {0.25F}, .basis = {4, -8}};
  layer.codes = {6, 2, 0, 1, 0, 0, 0, 0};  // [frequency][block]
  return layer;
}
LayerSum SumOfNothing() {
  return {2, 2, {1.0F, 10.0F, 100.0F}, {1.0F, 1.0F, 2.0F}};
}

TEST(LayerSumTest, IsMeanAndBasisTimesImages) {
  LayerSum sum = SumOfNothing();
  ASSERT_TRUE(sum.Add(FirstLayer()).ok());
  std::vector<uint32_t> btfels(8);
  std::iota(btfels.begin(), btfels.end(), 0u);
  const std::vector<float> values = sum.Coefficients(btfels);
  // Block 0: a constant of 6 * 0.5 / 2. Block 1: 2 * 0.5 / 2, and a cosine of 1 * 0.5 * 2 across, +-0.5 a
  // texel.
  const std::vector<float> image = {1.5F, 1.5F, 1.5F, 1.5F, 1.0F, 0.0F, 1.0F, 0.0F};
  for (int btfel = 0; btfel < 8; ++btfel) {
    EXPECT_NEAR(values[3 * btfel + 0], 1.0F + 1.0F * image[btfel], 1e-6F) << btfel;
    EXPECT_EQ(values[3 * btfel + 1], 10.0F);
    EXPECT_NEAR(values[3 * btfel + 2], 100.0F - 4.0F * image[btfel], 1e-5F) << btfel;
  }
  // A second layer makes the image finer, and brings coefficient 1.
  TileSetLayer second{.step = 0.125F, .coefficients = {1}, .spans = {1}, .basis_step = {1.0F}, .basis = {1}};
  second.codes.assign(16, 0);
  second.codes[0] = -1;
  second.codes[8] = 16;
  ASSERT_TRUE(sum.Add(second).ok());
  const std::vector<float> finer = sum.Coefficients(btfels);
  EXPECT_NEAR(finer[3 * 3 + 0], 1.0F + 1.5F - 0.0625F, 1e-6F);
  EXPECT_NEAR(finer[3 * 3 + 1], 11.0F, 1e-6F);
  EXPECT_NEAR(finer[3 * 4 + 1], 10.0F, 1e-6F);
  EXPECT_GE(sum.Bound(), *std::ranges::max_element(finer));
  EXPECT_LE(sum.Bound(), 120.0F);
}

TEST(LayerSumTest, RefusesWhatDoesNotFitAndStaysWhatItWas) {
  LayerSum sum = SumOfNothing();
  ASSERT_TRUE(sum.Add(FirstLayer()).ok());
  TileSetLayer next{.step = 0.1F, .coefficients = {1}};
  next.codes.assign(8, 3);
  const auto refused = [&](const auto& change, const char* what) {
    TileSetLayer layer = next;
    change(layer);
    const absl::Status status = sum.Add(layer);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << what;
    EXPECT_THAT(status.message(), HasSubstr(what));
    EXPECT_EQ(sum.num_layers(), 1u);
    EXPECT_EQ(sum.num_components(), 1u);
  };
  refused([](TileSetLayer& layer) { layer.step = 0.0F; }, "step 0");
  refused([](TileSetLayer& layer) { layer.step = std::numeric_limits<float>::quiet_NaN(); }, "step nan");
  refused([](TileSetLayer& layer) { layer.coefficients = {2}; }, "2 of 3");
  refused([](TileSetLayer& layer) { layer.coefficients = {3}; }, "3 of 3");
  refused([](TileSetLayer& layer) { layer.spans = {2}; }, "spans: layer 2");
  refused([](TileSetLayer& layer) { layer.spans = {1}; }, "basis_step: 0 values");
  refused([](TileSetLayer& layer) { layer.codes.pop_back(); }, "7 of 8");
  refused([](TileSetLayer& layer) { layer.basis = {1}; }, "1 of 0");
  refused([](TileSetLayer& layer) { layer.spans.assign(kMostLayerComponents, 0); },
          "257 in all of 8 BTFels, at most 256");
  EXPECT_TRUE(sum.Add(next).ok());
}

}  // namespace
}  // namespace tessera
