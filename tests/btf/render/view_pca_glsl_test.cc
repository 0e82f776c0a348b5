#include "btf/codec/view_pca/view_pca_glsl.h"

#include <cmath>

#include <gtest/gtest.h>

#include "btf/render/preview.h"
#include "btf/render/reference.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/blend_queries.h"
#include "tests/btf/render/hand_made.h"

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
    const auto glsl = FindCodec("view-pca")->Glsl(table);
    ASSERT_TRUE(glsl.ok()) << glsl.status();
    SCOPED_TRACE(c);
    testing::ExpectBlendsWhatTheDecoderBlends(table, *glsl, 2e-5);
  }
}

TEST(ViewPcaGlslTest, PreviewsAsTheReferenceDoes) {
  const Dressing dressing = testing::RandomDressing(testing::SkewedGrid(4, 0.3, 7), 8);
  const TileSet tile_set =
      testing::RandomTileSet(Encoded(5, RingDirections(4, 9), RingDirections(4, 12, 60.0)), 16, 3);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 160, .height = 120};
  scene.camera.eye = {0.6, -1.3, 1.8};
  scene.camera.fov_y_rad = RadFromDeg(60.0);
  scene.lights.push_back({.kind = Light::Kind::kPoint, .place = {-0.5, 0.2, 1.0}});
  const auto context = CreateOsmesaContext();
  ASSERT_TRUE(context.ok()) << context.status();
  const auto image = RenderGl(**context, scene, {});
  ASSERT_TRUE(image.ok()) << image.status();
  const auto reference = RenderReferenceWithDepth(scene, {});
  ASSERT_TRUE(reference.ok()) << reference.status();
  const testing::Comparison comparison = testing::CompareAwayFromSilhouettes(*image, *reference);
  EXPECT_LT(comparison.rmse, 1.0 / 255.0);
  EXPECT_LT(comparison.differing, 0.01);
  EXPECT_GT(comparison.pixels, 160U * 120 / 20);
}

TEST(ViewPcaGlslTest, FewDirections) {
  const std::vector<Direction> one = {{0.4, 1.0}};
  const std::vector<Direction> line = {{0.8, 1.0}, {0.0, 0.0}, {0.3, 1.0 + kPi}};
  const std::vector<Direction> two = {{0.8, 1.0}, {1.2, 4.0}};
  for (const auto& [views, lights] : {std::pair(one, line), {line, two}, {two, one}}) {
    const BtfelTable table = Encoded(3, views, lights);
    const auto glsl = FindCodec("view-pca")->Glsl(table);
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
