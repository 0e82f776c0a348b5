#include "btf/tiles/seam_embedding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stop_token>

#include <gtest/gtest.h>

#include "tests/btf/tiles/made_up_material.h"

namespace tessera {
namespace {

constexpr int kDims = 8;

double SquaredDistance(const Embedding& embedding, int turns, int x, int y) {
  double sum = 0.0;
  for (int i = 0; i < embedding.dims; ++i) {
    const double difference = embedding.at(turns, x, y)[i] - embedding.at(0, 0, 0)[i];
    sum += difference * difference;
  }
  return sum;
}

// A material twice as bright has the same distances, up to one factor for all of them.
TEST(SeamEmbeddingTest, DoesNotDependOnBrightness) {
  Material material = MakeMaterial(24, 20, Pattern::kBumps);
  const auto embedding = EmbedForSeams(material, kDims, {});
  ASSERT_TRUE(embedding.ok()) << embedding.status();
  for (float& step : material.btfels.step) {
    step *= 2.0f;
  }
  for (float& offset : material.btfels.offset) {
    offset *= 2.0f;
  }
  const auto brighter = EmbedForSeams(material, kDims, {});
  ASSERT_TRUE(brighter.ok()) << brighter.status();
  const double factor = brighter->total_variance / embedding->total_variance;
  for (const auto& [turns, x, y] : {std::array{0, 5, 3}, std::array{1, 7, 11}, std::array{3, 20, 2}}) {
    const double distance = SquaredDistance(*embedding, turns, x, y);
    EXPECT_NEAR(SquaredDistance(*brighter, turns, x, y), factor * distance, 1e-3 * factor * distance);
  }
}

// Rows that alternate under grazing lights alone, which are dim, count as much as columns that alternate
// under bright ones; with Codec::Embed they hardly count.
TEST(SeamEmbeddingTest, DimImagesCountAsMuchAsBrightOnes) {
  const Material material =
      MadeUpMaterial(16, 16, "view-pca", [](int x, int y, int /*channel*/, const Direction& light) {
        const bool is_grazing = light.theta_rad > RadFromDeg(60.0);
        return is_grazing ? 0.02 + 0.01 * (y % 2) : 0.5 + 0.3 * (x % 2);
      });
  const auto share_of_dim = [](const Embedding& embedding) {
    const double dim = SquaredDistance(embedding, 0, 0, 1);
    return dim / (dim + SquaredDistance(embedding, 0, 1, 0));
  };
  const auto of_codec = FindCodec("view-pca")->Embed(material, kDims, {});
  const auto for_seams = EmbedForSeams(material, kDims, {});
  ASSERT_TRUE(of_codec.ok() && for_seams.ok());
  EXPECT_LT(share_of_dim(*of_codec), 0.02);
  EXPECT_GT(share_of_dim(*for_seams), 0.2);
}

TEST(SeamEmbeddingTest, DoesNotDependOnThreads) {
  const Material material = MakeMaterial(24, 20, Pattern::kBumps, "view-pca");
  RunContext one;
  one.num_threads = 1;
  RunContext two;
  two.num_threads = 2;
  const auto a = EmbedForSeams(material, kDims, one);
  const auto b = EmbedForSeams(material, kDims, two);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_EQ(a->values, b->values);
}

TEST(SeamEmbeddingTest, TakesAMaterialOfOneColour) {
  Material material = MakeMaterial(24, 20, Pattern::kBumps);
  std::ranges::fill(material.btfels.codes, 100);
  const auto embedding = EmbedForSeams(material, kDims, {});
  ASSERT_TRUE(embedding.ok()) << embedding.status();
  for (const float value : embedding->values) {
    ASSERT_TRUE(std::isfinite(value));
  }
}

TEST(SeamEmbeddingTest, CanBeCancelled) {
  std::stop_source stop;
  stop.request_stop();
  RunContext context;
  context.stop = stop.get_token();
  EXPECT_EQ(EmbedForSeams(MakeMaterial(24, 20, Pattern::kBumps), kDims, context).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
