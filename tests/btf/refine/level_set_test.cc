#include "btf/refine/level_set.h"

#include <algorithm>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/codec/decoder.h"
#include "tests/btf/refine/errors.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

// The mean of all texels of a tile under one light and view, before the clamp.
Eigen::Array3d MeanOfTile(const TileSet& tile_set, int tile, const Eigen::Vector3d& light,
                          const Eigen::Vector3d& view) {
  const auto decoder = *MakeDecoder(tile_set.btfels);
  std::vector<double> values(tile_set.btfels.num_coefficients);
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  const int w = tile_set.tile_size;
  for (int i = 0; i < w * w; ++i) {
    const uint32_t texel = tile_set.texel(tile, i % w, i / w);
    decoder->Dequantize(tile_set.btfels.btfel(BtfelOfTexel(texel)), values);
    sum += decoder->Evaluate(values, UnturnedFromTurned(light, TurnsOfTexel(texel)),
                             UnturnedFromTurned(view, TurnsOfTexel(texel)));
  }
  return sum / (w * w);
}

class CodecLevelSetTest : public ::testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(AllCodecs, CodecLevelSetTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);

TEST_P(CodecLevelSetTest, StandsAloneAndKeepsTheMeanOfItsPatches) {
  const TileSet tile_set = PatchTileSetOf(GetParam(), 16);
  const auto far = MakeLevelSet(tile_set, 3, {});
  ASSERT_TRUE(far.ok()) << far.status();
  EXPECT_EQ(far->tile_set.tile_size, 8);  // cells of 2x2, a quarter of the strip height, not of 4x4
  EXPECT_EQ(SourceGridOf(far->tile_set)->footprint, 2);
  const auto bytes = SerializeTileSet(far->tile_set);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  const auto parsed = ParseTileSet(std::as_bytes(std::span(*bytes)));
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_EQ(SourceGridOf(*parsed)->footprint, 2);
  // Patches end at cells' sides: 8 bits alone are lost.
  EXPECT_LT(far->rmse, 0.003);
  const Eigen::Vector3d light = Eigen::Vector3d(0.3, 0.4, 1.0).normalized();
  const Eigen::Vector3d view = Eigen::Vector3d(-0.2, 0.3, 1.0).normalized();
  for (const int tile : {0, 17, 95}) {
    const Eigen::Array3d whole = MeanOfTile(tile_set, tile, light, view);
    const Eigen::Array3d alone = MeanOfTile(far->tile_set, tile, light, view);
    EXPECT_LT((whole - alone).abs().maxCoeff(), 0.005) << "tile " << tile;
    EXPECT_GT(whole.maxCoeff(), 0.1);
  }
}

// Each cell against the pixels of the patch that most of it shows, found without patches: of a set whose
// patches end in the midst of cells.
TEST(LevelSetTest, ACellShowsThePatchThatMostOfItShows) {
  TileSet tile_set = PatchTileSetOf("dsh-cls", 16);
  // All patches one texel to the right: a column of cells has three texels of one patch, or four.
  for (size_t row = 0; row < tile_set.tile_index.size(); row += 16) {
    std::rotate(tile_set.tile_index.begin() + static_cast<ptrdiff_t>(row),
                tile_set.tile_index.begin() + static_cast<ptrdiff_t>(row) + 15,
                tile_set.tile_index.begin() + static_cast<ptrdiff_t>(row) + 16);
  }
  const auto far = MakeLevelSet(tile_set, 2, {});
  ASSERT_TRUE(far.ok()) << far.status();
  const BtfelTable& table = far->tile_set.btfels;
  for (int tile = 0; tile < 96; ++tile) {
    for (const int x : {1, 2, 3, 5, 6, 7}) {  // cells of one patch
      const uint32_t got = far->tile_set.texel(tile, x, 3);
      double expected = 0.0;
      for (int i = 0; i < 4; ++i) {
        const uint32_t texel = tile_set.texel(tile, 2 * x + i % 2, 6 + i / 2);
        EXPECT_EQ(TurnsOfTexel(texel), TurnsOfTexel(got));
        expected += 0.25 * (tile_set.btfels.offset[5] +
                            tile_set.btfels.step[5] * tile_set.btfels.btfel(BtfelOfTexel(texel))[5]);
      }
      EXPECT_NEAR(table.offset[5] + table.step[5] * table.btfel(BtfelOfTexel(got))[5], expected,
                  0.51 * table.step[5] + 1e-6);
    }
  }
  EXPECT_GT(far->rmse, 0.003);  // seams moved
}

TEST(LevelSetTest, LevelOneHasTheTexelsOfTheTileSet) {
  const TileSet tile_set = PatchTileSetOf("dsh-cls", 16);
  const auto level = MakeLevelSet(tile_set, 1, {});
  ASSERT_TRUE(level.ok()) << level.status();
  EXPECT_EQ(level->tile_set.tile_index, tile_set.tile_index);
  EXPECT_EQ(level->tile_set.btfels.codes, tile_set.btfels.codes);
  EXPECT_EQ(level->rmse, 0.0);
}

TEST(LevelSetTest, NamesWhatThereIsNot) {
  TileSet tile_set = PatchTileSetOf("dsh-cls", 8);
  for (const int level : {0, 4, -1}) {
    const auto far = MakeLevelSet(tile_set, level, {});
    EXPECT_TRUE(absl::IsInvalidArgument(far.status()));
    EXPECT_THAT(far.status().message(), HasSubstr("levels 1 to 3"));
  }
  tile_set.metadata.erase("exemplar");
  const auto far = MakeLevelSet(tile_set, 2, {});
  EXPECT_TRUE(absl::IsFailedPrecondition(far.status()));
  EXPECT_THAT(far.status().message(), HasSubstr("where its BTFels lie in the exemplar"));
}

}  // namespace
}  // namespace tessera
