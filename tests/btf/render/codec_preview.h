// The picture of a codec's shader against the CPU reference, for the tests of each codec's GLSL.
#pragma once

#include <string_view>
#include <utility>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/codec/codec.h"
#include "btf/light/frequency_light.h"
#include "btf/render/preview.h"
#include "btf/render/reference.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/hand_made.h"

namespace tessera::testing {

// A few texels of a shiny material, turned at random in tiles.
inline TileSet EncodedTiles(std::string_view codec) {
  SampledBtf btf = ShinyBtf(8, 6, RingDirections(4, 9), RingDirections(4, 12, 60.0));
  const EncodeParams params{.kl = 9, .kv = 9, .eigen_textures = 3, .rank = 12};
  return RandomTileSet(FindCodec(codec)->Encode(btf, params, {})->btfels, 16, 3);
}

// Brighter than dark in every direction.
inline FrequencyLight RandomFrequencyLight(int n, uint64_t seed) {
  Rng rng(seed);
  Eigen::MatrixXd coefficients(n, 3);
  for (Eigen::Index i = 0; i < coefficients.size(); ++i) {
    coefficients.data()[i] = 0.5 * rng.NextDouble() - 0.25;
  }
  coefficients.row(0).setConstant(3.0);
  return FrequencyLight(coefficients);
}

inline void ExpectPreviewsAsTheReferenceDoes(BtfelTable table) {
  const Dressing dressing = RandomDressing(SkewedGrid(4, 0.3, 7), 8);
  const TileSet tile_set = RandomTileSet(std::move(table), 16, 3);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 160, .height = 120};
  scene.camera.eye = {0.6, -1.3, 1.8};
  scene.camera.fov_y_rad = RadFromDeg(60.0);
  scene.lights.push_back({.kind = Light::Kind::kPoint, .place = {-0.5, 0.2, 1.0}});
  const auto context = CreateOsmesaContext();
  ASSERT_TRUE(context.ok()) << context.status();
  const auto mips = MakeTileMips(tile_set, {}, {});
  ASSERT_TRUE(mips.ok()) << mips.status();
  const auto expect = [&] {
    const auto image = RenderGl(**context, scene, {});
    ASSERT_TRUE(image.ok()) << image.status();
    const auto reference = RenderReferenceWithDepth(scene, {});
    ASSERT_TRUE(reference.ok()) << reference.status();
    const Comparison comparison = CompareAwayFromSilhouettes(*image, *reference);
    EXPECT_LT(comparison.rmse, 0.5 / 255.0);
    EXPECT_LT(comparison.differing, 0.01);
    EXPECT_GT(comparison.pixels, static_cast<size_t>(scene.width) * scene.height / 20);
  };
  for (const Filter filter : {Filter::kBilinear, Filter::kNearest}) {
    scene.filter = filter;
    expect();
  }
  // Under light from all around, with a light and alone.
  const FrequencyLight sky = testing::RandomFrequencyLight(25, 5);
  scene.frequency_light = &sky;
  scene.filter = Filter::kBilinear;
  expect();
  const std::vector<Light> lights = std::exchange(scene.lights, {});
  expect();
  scene.lights = lights;
  // From so far that most levels are seen.
  scene.mips = &*mips;
  scene.lights.pop_back();
  scene.width = 48;
  scene.height = 36;
  scene.camera.eye = {1.2, -6.0, 2.4};
  scene.camera.fov_y_rad = RadFromDeg(20.0);
  expect();
}

}  // namespace tessera::testing
