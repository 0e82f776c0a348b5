#include "btf/tiles/anisotropy.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

constexpr int kSide = 96;

// Adds value(turn, pixel) to the first dimension.
template <typename Value>
Embedding With(Embedding embedding, const Value& value) {
  const int num_pixels = embedding.width * embedding.height;
  for (int turn = 0; turn < 4; ++turn) {
    for (int i = 0; i < num_pixels; ++i) {
      embedding.values[(static_cast<size_t>(turn) * num_pixels + i) * embedding.dims] +=
          static_cast<float>(value(turn, i));
    }
  }
  return embedding;
}

double AnisotropyOf(const Embedding& embedding, int num_threads = 0) {
  RunContext context;
  context.num_threads = num_threads;
  return MeasureAnisotropy(Exemplar(embedding), context);
}

TEST(AnisotropyTest, IsOneOfBumpsThatLookAlikeAfterATurn) {
  EXPECT_NEAR(AnisotropyOf(BumpyEmbedding(kSide, kSide, 3)), 1.0, 0.06);
  EXPECT_NEAR(AnisotropyOf(BumpyEmbedding(150, 70, 4)), 1.0, 0.06) << "neither square nor within 128 texels";
}

TEST(AnisotropyTest, SeesBumpsThatDoNotTurnWithTheLight) {
  // Slopes as they stand in the unturned picture: what a height map mistaken for a picture would be.
  Embedding embedding = BumpyEmbedding(kSide, kSide, 3);
  const size_t turn_size = embedding.values.size() / 4;
  for (int turn = 1; turn < 4; ++turn) {
    std::copy_n(embedding.values.begin(), turn_size, embedding.values.begin() + turn * turn_size);
  }
  EXPECT_GT(AnisotropyOf(embedding), 1.1);
}

TEST(AnisotropyTest, TellsStripesAndAMeanThatTurns) {
  const Embedding bumps = BumpyEmbedding(kSide, kSide, 3);
  EXPECT_GT(AnisotropyOf(With(bumps, [](int, int i) { return std::sin(0.8 * (i / kSide)); })),
            kAnisotropyLimit);
  EXPECT_GT(AnisotropyOf(With(bumps, [](int turn, int) { return turn % 2 == 0 ? 0.5 : -0.5; })),
            kAnisotropyLimit)
      << "brushed: the mean leans along x, so it turns with the picture";
}

TEST(AnisotropyTest, IsFiniteOfWhatRepeatsExactlyAndTheSameForAnyNumberOfThreads) {
  Embedding stripes = BumpyEmbedding(32, 32, 3);
  std::fill(stripes.values.begin(), stripes.values.end(), 0.0f);
  EXPECT_EQ(AnisotropyOf(stripes), 1.0) << "constant";
  stripes = With(stripes, [](int, int i) { return (i / 32) % 4 < 2 ? 1.0 : 0.0; });
  const double one = AnisotropyOf(stripes, 1);
  EXPECT_TRUE(std::isfinite(one));
  EXPECT_GT(one, 10.0);
  EXPECT_EQ(AnisotropyOf(stripes, 3), one);
}

}  // namespace
}  // namespace tessera
