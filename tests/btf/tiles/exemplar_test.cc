#include "btf/tiles/exemplar.h"

#include <array>
#include <vector>

#include <gtest/gtest.h>

#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

// numpy.rot90: the picture turned a quarter counter-clockwise.
std::vector<std::vector<int>> Rot90(const std::vector<std::vector<int>>& picture) {
  const size_t height = picture.size();
  const size_t width = picture[0].size();
  std::vector<std::vector<int>> turned(width, std::vector<int>(height));
  for (size_t y = 0; y < height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      turned[width - 1 - x][y] = picture[y][x];
    }
  }
  return turned;
}

TEST(ExemplarTest, TurnedPicturesAreNumpyRot90) {
  const Exemplar exemplar(BumpyEmbedding(7, 5, 1));
  std::vector<std::vector<int>> picture(5, std::vector<int>(7));
  for (int i = 0; i < 35; ++i) {
    picture[i / 7][i % 7] = i;
  }
  for (int turn = 0; turn < 4; ++turn) {
    ASSERT_EQ(exemplar.TurnedHeight(turn), static_cast<int>(picture.size()));
    ASSERT_EQ(exemplar.TurnedWidth(turn), static_cast<int>(picture[0].size()));
    for (int v = 0; v < exemplar.TurnedHeight(turn); ++v) {
      for (int u = 0; u < exemplar.TurnedWidth(turn); ++u) {
        const uint32_t texel = exemplar.TexelAt(turn, u, v);
        EXPECT_EQ(BtfelOfTexel(texel), static_cast<uint32_t>(picture[v][u]));
        EXPECT_EQ(TurnsOfTexel(texel), turn);
        EXPECT_EQ(exemplar.TurnedPosition(texel), (std::array<int, 2>{u, v}));
      }
    }
    picture = Rot90(picture);
  }
}

TEST(ExemplarTest, StepsFollowTheTurnedPicture) {
  const Exemplar exemplar(BumpyEmbedding(6, 4, 1));
  constexpr std::array<int, 4> kDx = {1, 0, -1, 0};
  constexpr std::array<int, 4> kDy = {0, -1, 0, 1};
  for (int turn = 0; turn < 4; ++turn) {
    for (int v = 0; v < exemplar.TurnedHeight(turn); ++v) {
      for (int u = 0; u < exemplar.TurnedWidth(turn); ++u) {
        const uint32_t texel = exemplar.TexelAt(turn, u, v);
        for (int direction = 0; direction < 4; ++direction) {
          const int uu = u + kDx[direction];
          const int vv = v + kDy[direction];
          const bool inside =
              uu >= 0 && vv >= 0 && uu < exemplar.TurnedWidth(turn) && vv < exemplar.TurnedHeight(turn);
          EXPECT_EQ(exemplar.Step(texel, direction), inside ? exemplar.TexelAt(turn, uu, vv) : kNoTexel);
          EXPECT_EQ(exemplar.Shift(texel, kDx[direction], kDy[direction]), exemplar.Step(texel, direction));
        }
      }
    }
  }
}

TEST(ExemplarTest, TurningATexelFourTimesChangesNothing) {
  const uint32_t texel = PackTexel(12, 3);
  EXPECT_EQ(TurnTexel(texel, 1), PackTexel(12, 0));
  EXPECT_EQ(TurnTexel(texel, 4), texel);
  EXPECT_EQ(TurnTexel(kNoTexel, 2), kNoTexel);
}

}  // namespace
}  // namespace tessera
