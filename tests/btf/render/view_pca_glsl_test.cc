#include "btf/codec/view_pca/view_pca_glsl.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/blend_queries.h"
#include "tests/btf/render/codec_preview.h"

namespace tessera {
namespace {

// A real encoding: random coefficients would hide which view and light they belong to.
BtfelTable Encoded(int eigen_textures, const std::vector<Direction>& views,
                   const std::vector<Direction>& lights) {
  SampledBtf btf = ShinyBtf(8, 5, views, lights);
  return FindCodec("view-pca")->Encode(btf, {.eigen_textures = eigen_textures}, {})->btfels;
}

TEST(ViewPcaGlslTest, BlendsWhatTheDecoderBlends) {
  const std::vector<Direction> views = RingDirections(4, 9);
  const std::vector<Direction> lights = RingDirections(4, 12, 60.0);
  for (const int c : {1, 4, 5, 36}) {
    const BtfelTable table = Encoded(c, views, lights);
    const auto glsl = FindCodec("view-pca")->Glsl(table, {});
    ASSERT_TRUE(glsl.ok()) << glsl.status();
    SCOPED_TRACE(c);
    testing::ExpectBlendsWhatTheDecoderBlends(table, *glsl, 2e-5);
  }
}

TEST(ViewPcaGlslTest, PreviewsAsTheReferenceDoes) {
  testing::ExpectPreviewsAsTheReferenceDoes(Encoded(5, RingDirections(4, 9), RingDirections(4, 12, 60.0)));
}

TEST(ViewPcaGlslTest, FewDirections) {
  const std::vector<Direction> one = {{0.4, 1.0}};
  const std::vector<Direction> line = {{0.8, 1.0}, {0.0, 0.0}, {0.3, 1.0 + kPi}};
  const std::vector<Direction> two = {{0.8, 1.0}, {1.2, 4.0}};
  for (const auto& [views, lights] : {std::pair(one, line), {line, two}, {two, one}}) {
    const BtfelTable table = Encoded(3, views, lights);
    const auto glsl = FindCodec("view-pca")->Glsl(table, {});
    ASSERT_TRUE(glsl.ok()) << glsl.status();
    testing::ExpectBlendsWhatTheDecoderBlends(table, *glsl, 2e-5);
  }
}

TEST(ViewPcaGlslTest, RefusesTablesThatDoNotFit) {
  BtfelTable table = Encoded(3, RingDirections(2, 5), RingDirections(2, 5));
  table.tables.erase("light_weights");
  EXPECT_EQ(ViewPcaGlsl(table).status().code(), absl::StatusCode::kInvalidArgument);
  table = Encoded(3, RingDirections(2, 5), RingDirections(2, 5));
  table.codes.pop_back();
  EXPECT_EQ(ViewPcaGlsl(table).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera
