#include <algorithm>
#include <cmath>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "btf/render/reference.h"
#include "btf/render/shadow_views.h"
#include "btf/wang/shapes.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using testing::CompareAwayFromSilhouettes;
using testing::Comparison;
using testing::RandomBtfels;
using testing::RandomDressing;
using testing::RandomTileSet;
using testing::SkewedGrid;
using testing::WhiteDiffuser;

// The bias moves edges; beyond this many pixels of a picture whose pixels are about as large as a map's
// texels it does so only where light grazes.
constexpr int kShadowMarginPixels = 3;
constexpr double kMostDifferingInShadow = 0.01;

class ShadowTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = CreateOsmesaContext();
    ASSERT_TRUE(context.ok()) << context.status();
    context_ = std::move(*context);
  }

  Image Draw(const PreviewScene& scene) {
    auto image = RenderGl(*context_, scene, {});
    EXPECT_TRUE(image.ok()) << image.status();
    return image.ok() ? *std::move(image) : Image(scene.width, scene.height, 4);
  }

  // Away from edges of shadows; returns how much of the picture is in the dark of all lights.
  double ExpectAgreement(const PreviewScene& scene) {
    const auto reference = RenderReferenceWithDepth(scene, {});
    EXPECT_TRUE(reference.ok()) << reference.status();
    if (!reference.ok()) {
      return 0.0;
    }
    const Comparison comparison = CompareAwayFromSilhouettes(Draw(scene), *reference, kShadowMarginPixels);
    EXPECT_LT(comparison.differing, kMostDifferingInShadow) << "of " << comparison.pixels << " pixels";
    EXPECT_GT(comparison.pixels, static_cast<size_t>(scene.width) * scene.height / 20);
    double dark = 0.0;
    for (size_t pixel = 0; pixel < reference->lit_somewhere.size(); ++pixel) {
      dark += reference->lit_everywhere[pixel] == 0 ? 1.0 : 0.0;
    }
    return dark / static_cast<double>(reference->lit_somewhere.size());
  }

  std::unique_ptr<OffscreenContext> context_;
};

struct ShadowCase {
  std::string_view name;
  Light light;
};

class ShadowLightTest : public ShadowTest, public ::testing::WithParamInterface<ShadowCase> {};

TEST_P(ShadowLightTest, GlMatchesExactVisibilityAwayFromTheEdgesOfShadows) {
  const TileSet tile_set = RandomTileSet(RandomBtfels(50, 4, 4, 2), 16, 3);
  for (const std::string_view shape : BuiltinShapeNames()) {
    SCOPED_TRACE(std::string(shape));
    const Dressing dressing = RandomDressing(*BuiltinShape(shape), 1);
    PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 160, .height = 120};
    scene.shadows = ShadowParams{};
    scene.camera = FramingCamera(dressing.mesh, scene.width, scene.height);
    scene.lights = {GetParam().light};
    const double dark = ExpectAgreement(scene);
    if (shape == "torus" || shape == "genus3") {
      EXPECT_GT(dark, 0.01);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Lights, ShadowLightTest,
    ::testing::Values(ShadowCase{"Directional", {.place = {0.9, 0.25, 0.6}}},
                      ShadowCase{"Far", {.kind = Light::Kind::kPoint, .place = {3.0, 1.0, 2.5}}},
                      // Within the bounding sphere, where six maps look about.
                      ShadowCase{"Near", {.kind = Light::Kind::kPoint, .place = {0.1, 0.35, 0.9}}},
                      ShadowCase{"Inside", {.kind = Light::Kind::kPoint, .place = {0.05, 0.2, 0.1}}}),
    [](const auto& info) { return std::string(info.param.name); });

TEST_F(ShadowTest, SeveralLightsOfBothKindsMatch) {
  const TileSet tile_set = RandomTileSet(RandomBtfels(50, 4, 4, 2), 16, 3);
  const Dressing dressing = RandomDressing(*BuiltinShape("torus"), 1);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 160, .height = 120};
  scene.shadows = ShadowParams{};
  scene.camera = FramingCamera(dressing.mesh, scene.width, scene.height);
  scene.lights = {{.place = {0.9, 0.3, 0.5}, .irradiance = {3.0, 1.0, 0.3}},
                  {.kind = Light::Kind::kPoint, .place = {-1.0, 1.0, 1.0}, .irradiance = {0.3, 1.0, 3.0}},
                  {.kind = Light::Kind::kPoint, .place = {0.0, 0.1, 0.1}, .irradiance = {0.2, 0.5, 0.1}}};
  ExpectAgreement(scene);
}

// Nothing but faces turned away shadows a plane or a convex solid: shadows change nothing, however grazing
// the light, neither in stripes (acne) nor by facets.
TEST_F(ShadowTest, PlanesAndConvexSolidsDoNotShadowThemselves) {
  const TileSet white = RandomTileSet(WhiteDiffuser(), 16, 3);
  for (const std::string_view shape : {"plane", "cube-sphere"}) {
    const Dressing dressing = RandomDressing(*BuiltinShape(shape), 1);
    PreviewScene scene{.dressing = &dressing, .tile_set = &white, .width = 64, .height = 48};
    scene.camera = FramingCamera(dressing.mesh, scene.width, scene.height);
    for (const double theta_deg : {0.0, 60.0, 89.0}) {
      for (const auto& [kind, distance] : {std::pair(Light::Kind::kDirectional, 1.0),
                                           {Light::Kind::kPoint, 2.1},
                                           {Light::Kind::kPoint, 8.0}}) {
        scene.lights = {{.kind = kind,
                         .place = distance * VectorFromDirection({RadFromDeg(theta_deg), 0.7}),
                         .irradiance = Eigen::Vector3d::Constant(distance * distance * kPi)}};
        scene.shadows.reset();
        const Image without = Draw(scene);
        const auto compare = [&](const Image& with) {
          double worst = 0.0;
          for (size_t i = 0; i < with.pixels.size(); ++i) {
            worst = std::max(worst, static_cast<double>(without.pixels[i] - with.pixels[i]));
          }
          return worst;
        };
        // What light is left within rounding of the horizon may go.
        constexpr double kAtTheHorizon = 0.03;
        for (const int map_size : {64, 512}) {
          scene.shadows = ShadowParams{.map_size = map_size};
          EXPECT_LT(compare(Draw(scene)), kAtTheHorizon) << shape << " " << theta_deg << " " << map_size;
        }
        const auto reference = RenderReference(scene, {});
        ASSERT_TRUE(reference.ok());
        EXPECT_LT(compare(*reference), kAtTheHorizon) << shape << " " << theta_deg;
      }
    }
  }
}

// A floor in the plane z = 0 and a square plate of half width `half` above it.
QuadMesh FloorAndPlate(double half, double height) {
  QuadMesh mesh = SkewedGrid(8, 0.0, 1);
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (const auto& [x, y] : {std::pair(-1, -1), {1, -1}, {1, 1}, {-1, 1}}) {
    mesh.positions.emplace_back(half * x, half * y, height);
    mesh.normals.emplace_back(0.0f, 0.0f, 1.0f);
  }
  mesh.quads.push_back({first, first + 1, first + 2, first + 3});
  return mesh;
}

// No peter-panning beyond the stated distance: the edge of a plate's shadow lies where it must, within what
// shadow_views.h says, also where the plate hardly floats.
TEST_F(ShadowTest, EdgesOfShadowsLieWithinTheBiasOfWhereTheyMust) {
  const TileSet white = RandomTileSet(WhiteDiffuser(), 16, 3);
  constexpr double kHalf = 0.25;
  for (const int map_size : {128, 1024}) {
    for (const double theta_deg : {30.0, 60.0, 75.0}) {
      const double theta = RadFromDeg(theta_deg);
      for (const double heights_of_bias : {1.5, 20.0}) {
        const Light light{.place = {std::sin(theta), 0.0, std::cos(theta)}};
        const Dressing flat = RandomDressing(FloorAndPlate(kHalf, 0.1), 1);
        const double texel = ShadowViewsOf(light, TriangulateSurface(flat.mesh), map_size)[0].texel_width;
        const double height = heights_of_bias * kShadowBiasTexels * texel;
        const Dressing dressing = RandomDressing(FloorAndPlate(kHalf, height), 1);
        PreviewScene scene{.dressing = &dressing, .tile_set = &white, .width = 256, .height = 64};
        scene.camera.eye = {0.0, 0.0, 20.0};
        scene.camera.fov_y_rad = 2.0 * std::atan(0.25 / 20.0);
        scene.lights = {light};
        scene.shadows = ShadowParams{.map_size = map_size};
        const Image image = Draw(scene);
        const double bound =
            texel * (kShadowBiasTexels * std::tan(theta) + std::sqrt(2.0) / std::cos(theta)) + 2.0 / 128.0;
        const double shift = -height * std::tan(theta);
        int dark = 0;
        for (int x = 0; x < scene.width; ++x) {
          const double place = (x + 0.5 - 128.0) / 128.0;
          const float value = image.at(x, 32)[0];
          if (std::abs(place) < kHalf + 0.02) {
            continue;  // the plate itself
          }
          const double beyond_edge = std::abs(place - shift) - kHalf;
          if (beyond_edge > bound) {
            EXPECT_NEAR(value, std::cos(theta), 2e-3) << map_size << " " << theta_deg << " " << place;
          } else if (beyond_edge < -bound) {
            EXPECT_EQ(value, 0.0f) << map_size << " " << theta_deg << " " << place;
            ++dark;
          }
        }
        if (-shift > bound + 0.05 && -shift < 0.9) {
          EXPECT_GT(dark, 0) << map_size << " " << theta_deg << " " << heights_of_bias;
        }
      }
    }
  }
}

// The maps of these lights do not all fit at once.
TEST_F(ShadowTest, BatchesOfLightsAddUp) {
  const TileSet tile_set = RandomTileSet(RandomBtfels(9, 1, 1, 5), 16, 3);
  const Dressing dressing = RandomDressing(*BuiltinShape("torus"), 1);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 48, .height = 36};
  scene.camera = FramingCamera(dressing.mesh, scene.width, scene.height);
  scene.shadows = ShadowParams{.map_size = 2048};
  std::vector<Light> lights;
  for (int i = 0; i < 9; ++i) {
    const Eigen::Vector3d place = VectorFromDirection({1.0, 0.7 * i});
    lights.push_back({.kind = i == 4 ? Light::Kind::kPoint : Light::Kind::kDirectional,
                      .place = i == 4 ? Eigen::Vector3d(0.3 * place) : place,
                      .irradiance = Eigen::Vector3d::Constant(0.2 + 0.1 * i)});
  }
  Image sum(scene.width, scene.height, 4);
  for (const Light& light : lights) {
    scene.lights = {light};
    const Image one = Draw(scene);
    for (size_t i = 0; i < sum.pixels.size(); ++i) {
      sum.pixels[i] += one.pixels[i];
    }
  }
  scene.lights = lights;
  const Image together = Draw(scene);
  for (size_t i = 0; i < sum.pixels.size(); ++i) {
    if (i % 4 < 3) {
      EXPECT_NEAR(together.pixels[i], sum.pixels[i], 1e-5f);
    }
  }
}

}  // namespace
}  // namespace tessera
