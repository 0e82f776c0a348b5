// Light from all around in pictures: the frequency domain and lights by importance against sums over every
// texel, with shadows and without.
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "btf/light/q2_tree.h"
#include "btf/math/spherical_harmonics.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/reference.h"
#include "btf/wang/shapes.h"
#include "tests/btf/light/environments.h"
#include "tests/btf/render/codec_preview.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using testing::CompareAwayFromSilhouettes;
using testing::Comparison;
using testing::EncodedTiles;
using testing::RandomDressing;

// A sum of harmonics of degrees 0 to 2, bright everywhere.
Eigen::Array3d SmoothSky(const Eigen::Vector3d& d) {
  const Eigen::Array3d base(1.0, 1.2, 1.5);
  return base + 0.3 * d.y() + Eigen::Array3d(0.2, 0.0, -0.2) * d.x() * d.z() +
         Eigen::Array3d(0.1, -0.2, 0.3) * (d.x() * d.x() - d.y() * d.y());
}

// Root of the mean square difference over that of the reference, over the pixels that the mesh covers.
double RelativeRmse(const Image& image, const Image& reference) {
  double difference = 0.0;
  double signal = 0.0;
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    if (i % 4 != 3 && reference.pixels[i / 4 * 4 + 3] == 1.0F) {
      difference += std::pow(image.pixels[i] - reference.pixels[i], 2);
      signal += std::pow(reference.pixels[i], 2);
    }
  }
  EXPECT_GT(signal, 0.1);
  return std::sqrt(difference / signal);
}

Image Reference(const PreviewScene& scene, const ReferenceEnvironment& environment = {}) {
  auto picture = RenderReferenceWithDepth(scene, {}, environment);
  EXPECT_TRUE(picture.ok()) << picture.status();
  return picture.ok() ? std::move(picture->image) : Image();
}

class EnvironmentLightTest : public ::testing::TestWithParam<std::string_view> {};

TEST_P(EnvironmentLightTest, TheFrequencyDomainIsTheSumOverTexels) {
  const auto context = CreateOsmesaContext();
  ASSERT_TRUE(context.ok()) << context.status();
  const TileSet tile_set = EncodedTiles(GetParam());
  const Environment sky =
      EnvironmentOf(EnvironmentLayout::kEquirect, 48, SmoothSky, {.rotation_rad = 0.7, .scale = 1.5});
  const auto light = FrequencyLight::Create(sky, 9);
  ASSERT_TRUE(light.ok()) << light.status();
  // The sphere is seen from its top, where normals look up, and from aside, where some look along +z, the
  // pole of the harmonics; the torus at a grazing angle.
  struct View {
    std::string_view shape;
    double azimuth_deg;
    double elevation_deg;
  };
  for (const View& view : {View{"cube-sphere", 5, 0}, View{"torus", 140, 5}}) {
    SCOPED_TRACE(std::string(view.shape));
    const Dressing dressing = RandomDressing(*BuiltinShape(view.shape), 1);
    PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 16, .height = 16};
    scene.lights.clear();
    scene.camera = *OrbitCamera(dressing.mesh,
                                {.azimuth_rad = RadFromDeg(view.azimuth_deg),
                                 .elevation_rad = RadFromDeg(view.elevation_deg),
                                 .distance = 1.7},
                                scene.width, scene.height);
    const Image texels = Reference(scene, {.environment = &sky, .negative_values = NegativeValues::kKeep});
    scene.frequency_light = &*light;
    EXPECT_LT(RelativeRmse(Reference(scene), texels), 1e-3);
    const auto gl = RenderGl(**context, scene, {});
    ASSERT_TRUE(gl.ok()) << gl.status();
    EXPECT_LT(RelativeRmse(*gl, texels), 2e-3);
  }
}

TEST_P(EnvironmentLightTest, LightsByImportanceAreThoseOfTheReference) {
  const auto context = CreateOsmesaContext();
  ASSERT_TRUE(context.ok()) << context.status();
  const TileSet tile_set = EncodedTiles(GetParam());
  const Dressing dressing = RandomDressing(*BuiltinShape("genus3"), 1);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 72, .height = 54};
  scene.camera =
      *OrbitCamera(dressing.mesh, {.azimuth_rad = 0.4, .distance = 0.5}, scene.width, scene.height);
  scene.lights = DirectionalLights(
      *Q2Tree(EnvironmentOf(EnvironmentLayout::kAngular, 32, SunnySky, {.scale = 0.3})).Lights(20));
  for (const bool has_shadows : {false, true}) {
    SCOPED_TRACE(has_shadows);
    if (has_shadows) {
      scene.shadows = ShadowParams{};
    }
    const auto image = RenderGl(**context, scene, {});
    ASSERT_TRUE(image.ok()) << image.status();
    const auto reference = RenderReferenceWithDepth(scene, {});
    ASSERT_TRUE(reference.ok()) << reference.status();
    const Comparison comparison = CompareAwayFromSilhouettes(*image, *reference, has_shadows ? 2 : 0);
    EXPECT_LT(comparison.rmse, 0.5 / 255.0) << "worst " << comparison.worst;
    EXPECT_GT(comparison.pixels, 100U);
  }
}

INSTANTIATE_TEST_SUITE_P(Codecs, EnvironmentLightTest,
                         ::testing::Values("dsh", "dsh-cls", "dsh-ls", "dfmf", "view-pca"),
                         [](const auto& info) {
                           std::string name(info.param);
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

// Shadows from the whole sky: more lights come closer to all texels, and without shadows they do not.
TEST(EnvironmentShadowTest, MoreLightsComeCloserToAllTexels) {
  const TileSet tile_set = EncodedTiles("dsh-cls");
  const Dressing dressing = RandomDressing(*BuiltinShape("torus"), 1);
  const Environment sky = EnvironmentOf(EnvironmentLayout::kEquirect, 32, SunnySky);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 32, .height = 24};
  scene.camera = *OrbitCamera(dressing.mesh, {.distance = 0.8}, scene.width, scene.height);
  scene.lights.clear();
  scene.shadows = ShadowParams{};
  const Image texels = Reference(scene, {.environment = &sky});
  const Q2Tree tree(sky);
  double before = 1.0;
  for (const int count : {4, 32, 256}) {
    scene.lights = DirectionalLights(*tree.Lights(count));
    const double error = RelativeRmse(Reference(scene), texels);
    EXPECT_LT(error, 0.6 * before) << count;
    before = error;
  }
  EXPECT_LT(before, 0.02);
  scene.shadows.reset();
  EXPECT_GT(RelativeRmse(Reference(scene), texels), 0.05);
}

}  // namespace
}  // namespace tessera
