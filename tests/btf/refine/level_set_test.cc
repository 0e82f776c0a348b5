#include "btf/refine/level_set.h"

#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/codec/decoder.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/hand_made.h"
#include "tests/support/codecs.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;
using testing::RandomTileSet;

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

INSTANTIATE_TEST_SUITE_P(AllCodecs, CodecLevelSetTest, ::testing::Values("dsh-cls", "dfmf", "view-pca"),
                         CodecTestName);

TEST_P(CodecLevelSetTest, StandsAloneAndKeepsTheMean) {
  SampledBtf btf = ShinyBtf(6, 6, RingDirections(3, 8), RingDirections(3, 8));
  auto material =
      Encode(GetParam(), btf, {.kl = 9, .kv = 9, .eigen_textures = 2, .rank = GetParam() == "dfmf" ? 12 : 0});
  ASSERT_TRUE(material.ok()) << material.status();
  const TileSet tile_set = RandomTileSet(std::move(material->btfels), 8, 3);
  const auto far = MakeLevelSet(tile_set, 2, {});
  ASSERT_TRUE(far.ok()) << far.status();
  EXPECT_EQ(far->tile_set.tile_size, 2);
  const auto bytes = SerializeTileSet(far->tile_set);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  EXPECT_TRUE(ParseTileSet(std::as_bytes(std::span(*bytes))).ok());
  // Turned texels of random tiles are the worst that can come: a real set's patches have one turn each.
  EXPECT_LT(far->rmse, 0.03);
  const Eigen::Vector3d light = Eigen::Vector3d(0.3, 0.4, 1.0).normalized();
  const Eigen::Vector3d view = Eigen::Vector3d(-0.2, 0.3, 1.0).normalized();
  for (const int tile : {0, 17, 95}) {
    const Eigen::Array3d whole = MeanOfTile(tile_set, tile, light, view);
    const Eigen::Array3d alone = MeanOfTile(far->tile_set, tile, light, view);
    EXPECT_LT((whole - alone).abs().maxCoeff(), 0.03) << "tile " << tile;
    EXPECT_GT(whole.maxCoeff(), 0.2);
  }
}

// Every second texel turned, of a material most of which is brighter lit from +x, the rest from +y: joined
// unturned, a level would be too bright lit from +x.
TEST_P(CodecLevelSetTest, TurnsWhatItJoins) {
  const std::vector<Direction> directions = RingDirections(3, 8);
  SampledBtf btf(6, 6, directions, directions);
  for (int texel = 0; texel < 36; ++texel) {
    for (size_t sample = 0; sample < 3 * directions.size() * directions.size(); ++sample) {
      const size_t light = sample % directions.size();
      const Eigen::Vector3d towards = VectorFromDirection(directions[light]);
      const double slope = 0.3 * (texel % 3 == 0 ? towards.y() : towards.x());
      btf.at(texel % 6, texel / 6, static_cast<int>(sample / directions.size() % 3),
             sample / directions.size() / 3, light) = static_cast<float>(0.4 + 0.002 * texel + slope);
    }
  }
  auto material =
      Encode(GetParam(), btf, {.kl = 9, .kv = 9, .eigen_textures = 2, .rank = GetParam() == "dfmf" ? 12 : 0});
  ASSERT_TRUE(material.ok()) << material.status();
  TileSet tile_set = RandomTileSet(std::move(material->btfels), 8, 3);
  for (size_t i = 0; i < tile_set.tile_index.size(); ++i) {
    tile_set.tile_index[i] = PackTexel(BtfelOfTexel(tile_set.tile_index[i]), static_cast<int>(i % 2));
  }
  const auto level = MakeLevelSet(tile_set, 3, {});
  ASSERT_TRUE(level.ok()) << level.status();
  const Eigen::Vector3d view(0.0, 0.0, 1.0);
  const Eigen::Vector3d from_x = Eigen::Vector3d(0.8, 0.0, 0.6);
  const Eigen::Vector3d from_y = Eigen::Vector3d(0.0, 0.8, 0.6);
  const Eigen::Vector3d from_minus_x = Eigen::Vector3d(-0.8, 0.0, 0.6);
  for (const Eigen::Vector3d& light : {from_x, from_y, from_minus_x}) {
    const Eigen::Array3d whole = MeanOfTile(tile_set, 5, light, view);
    EXPECT_LT((whole - MeanOfTile(level->tile_set, 5, light, view)).abs().maxCoeff(), 0.02)
        << light.transpose();
  }
}

TEST(LevelSetTest, NamesTheLevelsThatThereAre) {
  const TileSet tile_set = RandomTileSet(testing::RandomBtfels(9, 4, 4, 1), 8, 3);
  for (const int level : {0, 4, -1}) {
    const auto far = MakeLevelSet(tile_set, level, {});
    EXPECT_TRUE(absl::IsInvalidArgument(far.status()));
    EXPECT_THAT(far.status().message(), HasSubstr("levels 1 to 3"));
  }
}

}  // namespace
}  // namespace tessera
