#include "btf/tiles/siblings.h"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/btf/tiles/noise_exemplar.h"
#include "tests/btf/wang/turned_tiles.h"

namespace tessera {
namespace {

constexpr int kSize = 16;
constexpr int kMargin = 2;
constexpr Window kWindow = {2, 3, 10, 10};
constexpr Patch kPatch = {1, 4, 5};

// Three tiles: one not laid yet, one that shows the exemplar turned by kPatch.turn so that kPatch in kWindow
// repeats it, and one that does so two texels to the side.
std::vector<uint32_t> Tiles(const Exemplar& exemplar) {
  std::vector<uint32_t> texels(3 * kSize * kSize, kNoTexel);
  for (int tile = 1; tile < 3; ++tile) {
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const int u = kPatch.u + x - kWindow.x + 2 * (tile - 1);
        texels[(tile * kSize + y) * kSize + x] = exemplar.TexelAt(kPatch.turn, u, kPatch.v + y - kWindow.y);
      }
    }
  }
  return texels;
}

PatchCut TakingFirst(int num_texels) {
  PatchCut cut;
  cut.takes_new.assign(kWindow.width * kWindow.height, 0);
  std::fill_n(cut.takes_new.begin(), num_texels, 1);
  return cut;
}

TEST(SiblingsTest, RepeatsWhenMoreThanAShareOfTheWindowIsASiblingsInPlace) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 1));
  const std::vector<uint32_t> texels = Tiles(exemplar);
  const Siblings siblings(texels, kSize, kMargin, 0, {0});
  EXPECT_FALSE(siblings.Repeats(exemplar, kWindow, kPatch, TakingFirst(15)));
  EXPECT_TRUE(siblings.Repeats(exemplar, kWindow, kPatch, TakingFirst(16)));
}

TEST(SiblingsTest, IsNotItsOwnSiblingAndMayShowTheSameElsewhere) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 2));
  const std::vector<uint32_t> texels = Tiles(exemplar);
  EXPECT_FALSE(Siblings(texels, kSize, kMargin, 1, {0}).Repeats(exemplar, kWindow, kPatch, TakingFirst(100)));
  EXPECT_TRUE(Siblings(texels, kSize, kMargin, 2, {0}).Repeats(exemplar, kWindow, kPatch, TakingFirst(100)));
  const Patch turned = {2, kPatch.u, kPatch.v};
  EXPECT_FALSE(Siblings(texels, kSize, kMargin, 0, {0}).Repeats(exemplar, kWindow, turned, TakingFirst(100)));
}

TEST(SiblingsTest, SeesASiblingLaidTurned) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 4));
  std::vector<uint32_t> texels = Tiles(exemplar);
  constexpr size_t kArea = kSize * kSize;
  // Laid with a quarter turn, tile 1 looks as it did before.
  const std::vector<uint32_t> turned_back = TurnedTexels(std::span(texels).subspan(kArea, kArea), kSize, 3);
  std::ranges::copy(turned_back, texels.begin() + kArea);
  const auto repeats = [&](std::vector<int> turns) {
    return Siblings(texels, kSize, kMargin, 0, std::move(turns))
        .Repeats(exemplar, kWindow, kPatch, TakingFirst(100));
  };
  EXPECT_FALSE(repeats({0}));
  EXPECT_TRUE(repeats({0, 1}));
  EXPECT_FALSE(repeats({0, 2, 3}));
}

TEST(SiblingsTest, RepeatsAWholeTileByItsInside) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 5));
  const std::vector<uint32_t> texels = Tiles(exemplar);
  const Siblings siblings(texels, kSize, kMargin, 0, {0});
  const auto second = std::span(texels).subspan(kSize * kSize, kSize * kSize);
  std::vector<uint32_t> tile(kSize * kSize, 0);
  // 12 x 12 texels of inside: 21 are below 15%, 22 above.
  const auto show = [&](int count) {
    for (int i = 0; i < count; ++i) {
      const int at = (kMargin + i / 12) * kSize + kMargin + i % 12;
      tile[at] = second[at];
    }
  };
  std::copy_n(second.begin(), kMargin * kSize, tile.begin());
  show(21);
  EXPECT_FALSE(siblings.Repeats(tile));
  show(22);
  EXPECT_TRUE(siblings.Repeats(tile));
}

TEST(SiblingsTest, LooksAtTheInsideOnly) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 3));
  const std::vector<uint32_t> texels = Tiles(exemplar);
  // 10 x 1 texels of the window's first rows lie within a margin of 4, 10 x 9 do not; the first two columns
  // do.
  EXPECT_FALSE(Siblings(texels, kSize, 4, 0, {0}).Repeats(exemplar, kWindow, kPatch, TakingFirst(20)));
  EXPECT_TRUE(Siblings(texels, kSize, 4, 0, {0}).Repeats(exemplar, kWindow, kPatch, TakingFirst(30)));
}

}  // namespace
}  // namespace tessera
