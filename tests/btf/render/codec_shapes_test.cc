// Every codec on every built-in shape: the picture in GL against the reference, from the front and from
// aside, under several lights, with and without mip levels. Tiles are turned at random, so that turned
// texels meet across borders.
#include <algorithm>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "btf/render/reference.h"
#include "btf/wang/shapes.h"
#include "tests/btf/render/codec_preview.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using testing::CompareAwayFromSilhouettes;
using testing::Comparison;
using testing::RandomDressing;

constexpr double kRmseOfEveryCodec = 0.5 / 255.0;
constexpr double kMostDifferingOfEveryCodec = 0.01;

class CodecShapesTest : public ::testing::TestWithParam<std::string_view> {
 protected:
  void ExpectAgreement(OffscreenContext& context, const PreviewScene& scene) {
    const auto image = RenderGl(context, scene, {});
    ASSERT_TRUE(image.ok()) << image.status();
    const auto reference = RenderReferenceWithDepth(scene, {});
    ASSERT_TRUE(reference.ok()) << reference.status();
    const Comparison comparison = CompareAwayFromSilhouettes(*image, *reference);
    EXPECT_LT(comparison.rmse, kRmseOfEveryCodec) << "worst " << comparison.worst;
    EXPECT_LT(comparison.differing, kMostDifferingOfEveryCodec);
    EXPECT_GT(comparison.pixels, static_cast<size_t>(scene.width) * scene.height / 20);
    double brightest = 0.0;
    for (const float value : reference->image.pixels) {
      brightest = std::max(brightest, static_cast<double>(value));
    }
    EXPECT_GT(brightest, 0.1);
  }
};

TEST_P(CodecShapesTest, GlMatchesTheReference) {
  const auto context = CreateOsmesaContext();
  ASSERT_TRUE(context.ok()) << context.status();
  const TileSet tile_set = testing::EncodedTiles(GetParam());
  const auto mips = MakeTileMips(tile_set, {}, {});
  ASSERT_TRUE(mips.ok()) << mips.status();
  for (const std::string_view shape : BuiltinShapeNames()) {
    SCOPED_TRACE(std::string(shape));
    const Dressing dressing = RandomDressing(*BuiltinShape(shape), 1);
    PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 72, .height = 54};
    scene.lights = {{.kind = Light::Kind::kPoint, .place = {0.8, 1.1, 1.4}, .irradiance = {kPi, 2.0, 1.5}}};
    const auto orbit = [&](double azimuth_deg, double elevation_deg, double distance) {
      return *OrbitCamera(dressing.mesh,
                          {.azimuth_rad = RadFromDeg(azimuth_deg),
                           .elevation_rad = RadFromDeg(elevation_deg),
                           .distance = distance},
                          scene.width, scene.height);
    };
    scene.camera = orbit(3.0, 8.0, 0.35);
    ExpectAgreement(**context, scene);
    // From aside, under lights of both kinds, one of them grazing.
    scene.lights.push_back({.place = {-1.0, 0.1, 0.15}, .irradiance = {0.5, 1.0, 2.0}});
    scene.camera = orbit(50.0, 12.0, 0.5);
    ExpectAgreement(**context, scene);
    scene.mips = &*mips;
    ExpectAgreement(**context, scene);
    // Under light from all around, which harmonics of every order make, alone and beside the others.
    const FrequencyLight sky = testing::RandomFrequencyLight(16, 7);
    scene.frequency_light = &sky;
    ExpectAgreement(**context, scene);
    scene.mips = nullptr;
    scene.lights.clear();
    scene.camera = orbit(-20.0, 60.0, 0.35);
    ExpectAgreement(**context, scene);
  }
}

INSTANTIATE_TEST_SUITE_P(Codecs, CodecShapesTest,
                         ::testing::Values("dsh", "dsh-cls", "dsh-ls", "dfmf", "view-pca"),
                         [](const auto& info) {
                           std::string name(info.param);
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace tessera
