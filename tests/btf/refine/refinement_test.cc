#include "btf/refine/refinement.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/sha256.h"
#include "btf/codec/decoder.h"
#include "btf/wang/tile_set_parts.h"
#include "tests/btf/refine/errors.h"
#include "tests/support/codecs.h"

namespace tessera {
namespace {

class CodecRefinementTest : public ::testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(AllCodecs, CodecRefinementTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);

TEST_P(CodecRefinementTest, EveryPrefixIsAValidSetAndErrorsFallToNothing) {
  const TileSet tile_set = TileSetOf(GetParam(), 4);
  const auto k = static_cast<size_t>(tile_set.btfels.num_coefficients);
  const auto refinement = MakeRefinement(tile_set, SceneLight::kPoint, {});
  ASSERT_TRUE(refinement.ok()) << refinement.status();
  ASSERT_EQ(refinement->ends.size(), refinement->rmse.size());
  ASSERT_GE(refinement->ends.size(), 3u);
  EXPECT_EQ(refinement->ends.back(), k);
  EXPECT_EQ(refinement->rmse.back(), 0.0);
  const auto cutter = TileSetCutter::Create(
      tile_set, {.order = refinement->order, .ends = refinement->ends, .fill = refinement->fill});
  ASSERT_TRUE(cutter.ok()) << cutter.status();
  const std::string first = cutter->Part(0, "").value();
  auto assembler = TileSetAssembler::Begin(std::as_bytes(std::span(first)));
  ASSERT_TRUE(assembler.ok()) << assembler.status();
  double last = INFINITY;
  for (size_t i = 0; i < refinement->ends.size(); ++i) {
    if (i > 0) {
      const std::string part = cutter->Part(i, Sha256Hex(std::as_bytes(std::span(first)))).value();
      const absl::Status added = assembler->Add(std::as_bytes(std::span(part)));
      ASSERT_TRUE(added.ok()) << added;
      EXPECT_LT(refinement->rmse[i], refinement->rmse[i - 1]);
    }
    EXPECT_EQ(assembler->num_coefficients(), refinement->ends[i]);
    const auto bytes = SerializeTileSet(assembler->tile_set());
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    const auto parsed = ParseTileSet(std::as_bytes(std::span(*bytes)));
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    const double rmse = RmseBetween(tile_set, *parsed);
    EXPECT_LE(rmse, last * 1.02 + kDirectionRounding) << "prefix " << i;
    EXPECT_LE(rmse, refinement->rmse[i] * kMostErrorRatio + kDirectionRounding);
    EXPECT_GE(rmse, refinement->rmse[i] / kMostErrorRatio);
    last = rmse;
  }
  EXPECT_TRUE(assembler->is_complete());
  EXPECT_LE(last, kDirectionRounding);
}

TEST_P(CodecRefinementTest, EnvironmentsHaveAnOrderOfTheirOwn) {
  const TileSet tile_set = TileSetOf(GetParam(), 4);
  const auto point = MakeRefinement(tile_set, SceneLight::kPoint, {});
  const auto sky = MakeRefinement(tile_set, SceneLight::kEnvironment, {});
  ASSERT_TRUE(point.ok()) << point.status();
  ASSERT_TRUE(sky.ok()) << sky.status();
  EXPECT_NE(point->directions, sky->directions);
  EXPECT_TRUE(std::ranges::is_sorted(sky->rmse, std::greater()));
  // Soft light hides what changes fast with the light.
  EXPECT_LT(sky->rmse.front(), point->rmse.front());
  EXPECT_EQ(MakeRefinement(tile_set, SceneLight::kEnvironment, {})->order, sky->order);
}

TEST(RefinementTest, StopsWhenAsked) {
  const TileSet tile_set = TileSetOf("dsh-cls", 4);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(
      absl::IsCancelled(MakeRefinement(tile_set, SceneLight::kPoint, {.stop = stop.get_token()}).status()));
}

}  // namespace
}  // namespace tessera
