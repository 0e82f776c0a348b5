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
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/hand_made.h"
#include "tests/support/codecs.h"

namespace tessera {
namespace {

using testing::RandomTileSet;

// Directions of the plan are a choice among all; with so few texels their errors differ by less than this.
constexpr double kMostErrorRatio = 1.6;
// Stored directions are float32.
constexpr double kDirectionRounding = 1e-6;

TileSet TileSetOf(const std::string& codec) {
  SampledBtf btf = ShinyBtf(6, 6, RingDirections(3, 6), RingDirections(3, 7));
  auto material =
      Encode(codec, btf, {.kl = 16, .kv = 9, .eigen_textures = 3, .rank = codec == "dfmf" ? 16 : 0});
  EXPECT_TRUE(material.ok()) << material.status();
  return RandomTileSet(std::move(material->btfels), 4, 5);
}

// Over all texels of the table and all measured directions, by another way than the plan's.
double RmseBetween(const TileSet& a, const TileSet& b) {
  const auto decoder_a = *MakeDecoder(a.btfels);
  const auto decoder_b = *MakeDecoder(b.btfels);
  double squares = 0.0;
  size_t count = 0;
  for (const Direction& view : a.btfels.views) {
    for (const Direction& light : a.btfels.lights) {
      for (size_t i = 0; i < a.tile_index.size(); i += 37) {
        const auto value = [&](const TileSet& set, const Decoder& decoder) {
          return decoder.Decode(set.btfels.btfel(BtfelOfTexel(set.tile_index[i])), VectorFromDirection(light),
                                VectorFromDirection(view), 0);
        };
        squares += (value(a, *decoder_a) - value(b, *decoder_b)).square().sum();
        count += 3;
      }
    }
  }
  return std::sqrt(squares / static_cast<double>(count));
}

class CodecRefinementTest : public ::testing::TestWithParam<std::string> {};

INSTANTIATE_TEST_SUITE_P(AllCodecs, CodecRefinementTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);

TEST_P(CodecRefinementTest, EveryPrefixIsAValidSetAndErrorsFallToNothing) {
  const TileSet tile_set = TileSetOf(GetParam());
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
  const TileSet tile_set = TileSetOf(GetParam());
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
  const TileSet tile_set = TileSetOf("dsh-cls");
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(
      absl::IsCancelled(MakeRefinement(tile_set, SceneLight::kPoint, {.stop = stop.get_token()}).status()));
}

}  // namespace
}  // namespace tessera
