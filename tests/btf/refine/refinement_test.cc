#include "btf/refine/refinement.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/codec/decoder.h"
#include "btf/refine/set_layers.h"
#include "btf/wang/tile_set_parts.h"
#include "tests/btf/refine/errors.h"
#include "tests/support/codecs.h"

namespace tessera {
namespace {

class CodecRefinementTest : public ::testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(AllCodecs, CodecRefinementTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);

TEST_P(CodecRefinementTest, EveryPrefixIsAValidSetAndErrorsFallToNothing) {
  const TileSet tile_set = TileSetOf(GetParam(), 4);
  const auto refinement = MakeRefinement(tile_set, {}, {});
  ASSERT_TRUE(refinement.ok()) << refinement.status();
  ASSERT_GE(refinement->rmse.size(), 3u);
  EXPECT_EQ(TileSetCutter::Create(tile_set, refinement->cut)->num_parts(), refinement->rmse.size());
  EXPECT_EQ(refinement->cut.layers == nullptr, tile_set.btfels.num_coefficients <= kMostComponents);
  EXPECT_TRUE(std::ranges::is_sorted(refinement->rmse, std::greater()));
  EXPECT_EQ(refinement->rmse.back(), 0.0);
  double last = INFINITY;
  ForPrefixes(tile_set, refinement->cut, [&](size_t i, TileSetAssembler& assembler) {
    const auto bytes = SerializeTileSet(assembler.tile_set());
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    const auto parsed = ParseTileSet(std::as_bytes(std::span(*bytes)));
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    const double rmse = RmseBetween(tile_set, *parsed);
    // Layers lower the error over the plan's directions, which over all may be another one.
    const double most_rise = refinement->cut.layers == nullptr ? 1.02 : 1.25;
    EXPECT_LE(rmse, last * most_rise + k8BitRmse) << "prefix " << i;
    EXPECT_LE(rmse, refinement->rmse[i] * kMostErrorRatio +
                        (assembler.is_complete() ? kDirectionRounding : k8BitRmse));
    // Exact parts behind the layers state what the layers reached.
    const bool is_behind = refinement->cut.layers != nullptr && i > refinement->cut.layers->layers.size();
    EXPECT_GE(rmse, is_behind ? 0.0 : refinement->rmse[i] / kMostErrorRatio) << "prefix " << i;
    last = rmse;
  });
  EXPECT_LE(last, kDirectionRounding);
}

TEST_P(CodecRefinementTest, AllPartsTogetherAreTheTileSet) {
  const TileSet tile_set = TileSetOf(GetParam(), 4);
  const auto refinement = MakeRefinement(tile_set, {}, {});
  ASSERT_TRUE(refinement.ok()) << refinement.status();
  ForPrefixes(tile_set, refinement->cut, [&](size_t, TileSetAssembler& assembler) {
    if (assembler.is_complete()) {
      const TileSet& whole = assembler.tile_set();
      EXPECT_EQ(whole.btfels.codes, tile_set.btfels.codes);
      EXPECT_EQ(whole.btfels.offset, tile_set.btfels.offset);
      EXPECT_EQ(whole.btfels.step, tile_set.btfels.step);
      for (const auto& [name, table] : tile_set.btfels.tables) {
        EXPECT_EQ(whole.btfels.tables.at(name).values, table.values) << name;
      }
    }
  });
}

TEST_P(CodecRefinementTest, EnvironmentsHaveAnOrderOfTheirOwn) {
  const TileSet tile_set = TileSetOf(GetParam(), 4);
  const auto point = MakeRefinement(tile_set, {}, {});
  const auto sky = MakeRefinement(tile_set, {.light = SceneLight::kEnvironment}, {});
  ASSERT_TRUE(point.ok()) << point.status();
  ASSERT_TRUE(sky.ok()) << sky.status();
  EXPECT_NE(point->directions, sky->directions);
  EXPECT_TRUE(std::ranges::is_sorted(sky->rmse, std::greater()));
  // Soft light hides what changes fast with the light.
  EXPECT_LT(sky->rmse.front(), point->rmse.front());
  EXPECT_EQ(MakeRefinement(tile_set, {.light = SceneLight::kEnvironment}, {})->cut.order, sky->cut.order);
}

TEST(RefinementTest, StopsWhenAsked) {
  const TileSet tile_set = TileSetOf("dsh-cls", 4);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(absl::IsCancelled(MakeRefinement(tile_set, {}, {.stop = stop.get_token()}).status()));
}

}  // namespace
}  // namespace tessera
