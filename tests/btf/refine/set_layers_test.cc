#include "btf/refine/set_layers.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/refine/level_set.h"
#include "btf/wang/tile_set_parts.h"
#include "tests/btf/refine/errors.h"

namespace tessera {
namespace {

constexpr int kLevel = 2;
constexpr int kCellsAcross = 2;  // of a texel of the level

TileSet LevelOf(const std::string& codec) {
  TileSet whole = PatchTileSetOf(codec, 16);
  auto level = MakeLevelSet(whole, kLevel, {});
  EXPECT_TRUE(level.ok()) << level.status();
  EXPECT_EQ(level->tile_set.tile_size, 8);
  return std::move(level->tile_set);
}

absl::StatusOr<SetLayers> LayersOf(const TileSet& level, SceneLight light = SceneLight::kPoint,
                                   const RunContext& context = {}) {
  return MakeSetLayers(level, {.level = kLevel, .exact = {}, .light = light}, context);
}

// Layers alone.
TileSetCut CutOf(const TileSet& level, const SetLayers& layers, std::vector<uint32_t> tiles = {}) {
  TileSetCut cut;
  cut.tiles = std::move(tiles);
  cut.fill.assign(level.btfels.num_coefficients, 0.0F);
  cut.layers = layers.layers;
  return cut;
}

class CodecLayersTest : public ::testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(AllCodecs, CodecLayersTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);

// The plan's errors against those of the sets that the parts make, over all directions.
TEST_P(CodecLayersTest, EveryPrefixIsAValidSetWhoseErrorIsAsStated) {
  const TileSet level = LevelOf(GetParam());
  const auto layered = LayersOf(level);
  ASSERT_TRUE(layered.ok()) << layered.status();
  ASSERT_GE(layered->rmse.size(), 3u);
  EXPECT_LE(layered->rmse.back(), kLayersEndRmse);
  EXPECT_TRUE(std::ranges::is_sorted(layered->rmse, std::greater()));
  const TileSetCut cut = CutOf(level, *layered);
  ASSERT_EQ(cut.layers->layers.size(), layered->rmse.size());
  ForPrefixes(level, cut, [&](size_t i, TileSetAssembler& assembler) {
    const auto bytes = SerializeTileSet(assembler.tile_set());
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    const auto parsed = ParseTileSet(std::as_bytes(std::span(*bytes)));
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    const double rmse = RmseBetween(level, *parsed, kCellsAcross);
    EXPECT_LE(rmse, layered->rmse[i] * kMostErrorRatio + k8BitRmse) << "part " << i;
    EXPECT_GE(rmse, layered->rmse[i] / kMostErrorRatio) << "part " << i;
  });
}

// Of a material whose texels differ along one line.
TEST_P(CodecLayersTest, OneComponentServesAMaterialOfOneDimension) {
  TileSet level = LevelOf(GetParam());
  BtfelTable& table = level.btfels;
  const auto k = static_cast<size_t>(table.num_coefficients);
  const std::vector<uint8_t> ends(table.codes.begin(), table.codes.begin() + static_cast<ptrdiff_t>(k));
  for (size_t btfel = 0; btfel < table.size(); ++btfel) {
    const auto share = static_cast<double>(btfel) / static_cast<double>(table.size());
    for (size_t c = 0; c < k; ++c) {
      const double end = ends[c];
      table.codes.data()[btfel * k + c] = static_cast<uint8_t>(std::lround(128.0 + share * (end - 128.0)));
    }
  }
  const auto layered = LayersOf(level);
  ASSERT_TRUE(layered.ok()) << layered.status();
  size_t components = 0;
  for (const TileSetLayer& layer : layered->layers->layers) {
    components += layer.basis_step.size();
  }
  EXPECT_EQ(components, 1u);
  EXPECT_LE(layered->rmse.back(), kLayersEndRmse);
}

TEST_P(CodecLayersTest, EnvironmentsHaveComponentsOfTheirOwnAndAllIsRepeatable) {
  const TileSet level = LevelOf(GetParam());
  const auto sky = LayersOf(level, SceneLight::kEnvironment);
  const auto again = LayersOf(level, SceneLight::kEnvironment);
  ASSERT_TRUE(sky.ok()) << sky.status();
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(sky->rmse, again->rmse);
  const auto part = [&](const SetLayers& layers) {
    return TileSetCutter::Create(level, CutOf(level, layers, {3, 90}))->Part(0, "").value();
  };
  EXPECT_EQ(part(*sky), part(*again));
  const auto point = LayersOf(level);
  EXPECT_NE(part(*sky), part(*point));
}

TEST(SetLayersTest, StopsWhenAsked) {
  const TileSet level = LevelOf("dsh-cls");
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(absl::IsCancelled(LayersOf(level, SceneLight::kPoint, {.stop = stop.get_token()}).status()));
}

}  // namespace
}  // namespace tessera
