#include "btf/render/sheet.h"

#include <gtest/gtest.h>

#include "btf/codec/decoder.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using testing::RandomBtfels;
using testing::RandomTileSet;

TEST(RenderTileSheet, ShowsEveryTexelTurnedAndLeavesGapsClear) {
  const TileSet tile_set = RandomTileSet(RandomBtfels(30, 9, 4, 1), 16, 2);
  const SheetParams params{
      .light = {RadFromDeg(40.0), 1.0}, .view = {RadFromDeg(20.0), 2.0}, .columns = 12, .gap = 3};
  const auto sheet = RenderTileSheet(tile_set, params, RunContext{});
  ASSERT_TRUE(sheet.ok()) << sheet.status();
  EXPECT_EQ(sheet->width, 12 * 19 + 3);
  EXPECT_EQ(sheet->height, 8 * 19 + 3);
  EXPECT_EQ(sheet->at(2, 50)[3], 0.0f);
  const auto decoder = MakeDecoder(tile_set.btfels);
  ASSERT_TRUE(decoder.ok());
  for (const int tile : {0, 13, 95}) {
    for (const int x : {0, 7, 15}) {
      const uint32_t texel = tile_set.texel(tile, x, 5);
      const Eigen::Array3d expected =
          (*decoder)->Decode(tile_set.btfels.btfel(BtfelOfTexel(texel)), VectorFromDirection(params.light),
                             VectorFromDirection(params.view), TurnsOfTexel(texel));
      const float* pixel = sheet->at(3 + tile % 12 * 19 + x, 3 + tile / 12 * 19 + 5);
      for (int c = 0; c < 3; ++c) {
        EXPECT_FLOAT_EQ(pixel[c], static_cast<float>(expected[c]));
      }
      EXPECT_EQ(pixel[3], 1.0f);
    }
  }
}

TEST(RenderTileSheet, ShowsSeamsBesideTheTiles) {
  TileSet tile_set = RandomTileSet(RandomBtfels(30, 9, 4, 1), 16, 2);
  EXPECT_EQ(RenderTileSheet(tile_set, {.seam_heat = true}, RunContext{}).status().code(),
            absl::StatusCode::kInvalidArgument);
  tile_set.seam_heat.assign(tile_set.tile_index.size(), 0);
  tile_set.seam_heat[17] = 64;  // tile 0, (1, 1): as the material
  tile_set.seam_heat[34] = 255;
  const auto sheet = RenderTileSheet(tile_set, {.columns = 12, .gap = 3, .seam_heat = true}, RunContext{});
  ASSERT_TRUE(sheet.ok()) << sheet.status();
  EXPECT_EQ(sheet->width, 2 * 12 * 19 + 3);
  const float* const tile = sheet->at(12 * 19 + 3, 3);
  const float* const natural = sheet->at(12 * 19 + 4, 4);
  const float* const visible = sheet->at(12 * 19 + 5, 5);
  EXPECT_TRUE(tile[0] == tile[1] && tile[1] == tile[2]);
  EXPECT_GT(natural[2], 5.0f * natural[0]);
  EXPECT_GT(visible[0], 5.0f * visible[2]);
  EXPECT_EQ(visible[3], 1.0f);
}

TEST(RenderTileSheet, RefusesBadParametersAndTileSets) {
  TileSet tile_set = RandomTileSet(RandomBtfels(30, 1, 1, 1), 16, 2);
  const auto code = [&](const SheetParams& params) {
    return RenderTileSheet(tile_set, params, RunContext{}).status().code();
  };
  const auto invalid = absl::StatusCode::kInvalidArgument;
  EXPECT_EQ(code({.gap = -1}), invalid);
  EXPECT_EQ(code({.gap = 257}), invalid);
  EXPECT_EQ(code({.columns = 97}), invalid);
  EXPECT_EQ(code({.light = {RadFromDeg(90.0), 0.0}}), invalid);
  EXPECT_EQ(code({.view = {0.0, std::nan("")}}), invalid);
  tile_set.tile_index.back() = PackTexel(30, 0);
  EXPECT_EQ(code({}), invalid);
  tile_set.tile_index.pop_back();
  EXPECT_EQ(code({}), invalid);
}

}  // namespace
}  // namespace tessera
