#include "btf/render/preview.h"

#include <algorithm>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "btf/render/offscreen_context.h"
#include "btf/render/reference.h"
#include "btf/wang/dress.h"
#include "btf/wang/shapes.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using testing::AsSurface96;
using testing::CompareAwayFromSilhouettes;
using testing::Comparison;
using ::testing::HasSubstr;
using testing::RandomBtfels;
using testing::RandomDressing;
using testing::RandomTileSet;
using testing::SkewedGrid;
using testing::WhiteDiffuser;

constexpr double kRmseLimit = 0.5 / 255.0;
// Samples within rounding of an edge of two faces, or of the limit between two filters, may fall either way.
constexpr double kMostDiffering = 0.01;
constexpr int kWidth = 160;
constexpr int kHeight = 120;

class PreviewTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto context = CreateOsmesaContext();
    ASSERT_TRUE(context.ok()) << context.status();
    context_ = std::move(*context);
  }

  // Both pictures agree; returns the reference.
  ReferencePicture ExpectAgreement(const PreviewScene& scene) {
    const auto image = RenderGl(*context_, scene, run_);
    EXPECT_TRUE(image.ok()) << image.status();
    auto reference = RenderReferenceWithDepth(scene, run_);
    EXPECT_TRUE(reference.ok()) << reference.status();
    if (!image.ok() || !reference.ok()) {
      return {};
    }
    const Comparison comparison = CompareAwayFromSilhouettes(*image, *reference);
    EXPECT_LT(comparison.rmse, kRmseLimit) << "worst " << comparison.worst;
    EXPECT_LT(comparison.differing, kMostDiffering);
    EXPECT_GT(comparison.pixels, static_cast<size_t>(scene.width) * scene.height / 20);
    ::testing::Test::RecordProperty("rmse_by_limit", std::to_string(comparison.rmse / kRmseLimit));
    return *std::move(reference);
  }

  std::unique_ptr<OffscreenContext> context_;
  RunContext run_;
};

class ShapePreviewTest : public PreviewTest, public ::testing::WithParamInterface<std::string_view> {};

TEST_P(ShapePreviewTest, GlMatchesTheReferenceUnderBothKindsOfLight) {
  const auto mesh = BuiltinShape(GetParam());
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  const Dressing dressing = RandomDressing(*mesh, 1);
  const TileSet tile_set = RandomTileSet(RandomBtfels(200, 25, 25, 2), 16, 3);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = kWidth, .height = kHeight};
  scene.camera = FramingCamera(dressing.mesh, kWidth, kHeight);
  ExpectAgreement(scene);
  scene.lights = {{.kind = Light::Kind::kPoint, .place = {0.8, 1.1, 1.4}, .irradiance = {kPi, 2.0, 1.5}}};
  ExpectAgreement(scene);
}

INSTANTIATE_TEST_SUITE_P(Builtin, ShapePreviewTest, ::testing::ValuesIn(BuiltinShapeNames()),
                         [](const auto& info) {
                           std::string name(info.param);
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST_F(PreviewTest, GlMatchesTheReferenceOnTilesLaidTurnedAndShowsTurnedTiles) {
  const QuadMesh mesh = *BuiltinShape("genus3");
  const Dressing turned = DressMesh(mesh, **FindArrangement("surface-26"), {}, run_)->dressing;
  const Dressing unturned = DressMesh(mesh, **FindArrangement("surface-96"), {}, run_)->dressing;
  const TileSet few = RandomTileSet(RandomBtfels(64, 9, 9, 2), 16, 3, "surface-26");
  const TileSet all = AsSurface96(few);
  PreviewScene scene{.dressing = &turned, .tile_set = &few, .width = kWidth, .height = kHeight};
  scene.camera = FramingCamera(mesh, kWidth, kHeight);
  ExpectAgreement(scene);
  const auto image = RenderGl(*context_, scene, run_);
  scene.dressing = &unturned;
  scene.tile_set = &all;
  const auto expected = RenderReferenceWithDepth(scene, run_);
  ASSERT_TRUE(image.ok() && expected.ok()) << image.status() << expected.status();
  // Nearest taps break their ties along the columns and rows of the tile, so single texels may differ.
  const Comparison comparison = CompareAwayFromSilhouettes(*image, *expected);
  EXPECT_LT(comparison.rmse, 2.0 * kRmseLimit) << "worst " << comparison.worst;
}

TEST_F(PreviewTest, GlMatchesTheReferenceOnSkewedQuadsMagnifiedAndMinified) {
  const Dressing dressing = RandomDressing(SkewedGrid(4, 0.3, 7), 8);
  for (const int tile_size : {16, 96}) {
    const TileSet tile_set = RandomTileSet(RandomBtfels(50, 16, 9, 2), tile_size, 3);
    PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = kWidth, .height = kHeight};
    scene.camera.eye = {0.6, -1.3, 1.8};
    scene.camera.fov_y_rad = RadFromDeg(60.0);
    scene.lights.push_back({.kind = Light::Kind::kPoint, .place = {-0.5, 0.2, 1.0}});
    ExpectAgreement(scene);
    scene.filter = Filter::kNearest;
    ExpectAgreement(scene);
  }
}

TEST_F(PreviewTest, GlMatchesTheReferenceWithMipLevels) {
  const Dressing dressing = RandomDressing(SkewedGrid(4, 0.3, 7), 8);
  // One part a texel; four; tiles that end with 3 x 3 texels.
  for (const auto& [basis, tile_size] :
       {std::pair(testing::BasisKind::kOrthonormal, 64), std::pair(testing::BasisKind::kGeneral, 64),
        std::pair(testing::BasisKind::kIdentity, 24)}) {
    const TileSet tile_set = RandomTileSet(RandomBtfels(50, 9, 4, 2, basis), tile_size, 3);
    const auto mips = MakeTileMips(tile_set, {}, run_);
    ASSERT_TRUE(mips.ok()) << mips.status();
    PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 96, .height = 72};
    scene.mips = &*mips;
    scene.lights = {{.kind = Light::Kind::kPoint, .place = {-0.5, 0.2, 1.0}}};
    scene.camera.fov_y_rad = RadFromDeg(60.0);
    // Along the surface, so that near and far texels are seen, and from afar.
    scene.camera.eye = {0.3, -1.4, 0.5};
    ExpectAgreement(scene);
    scene.camera.eye = {1.5, -4.0, 5.0};
    scene.camera.fov_y_rad = RadFromDeg(30.0);
    ExpectAgreement(scene);
    if (tile_size == 24) {
      scene.filter = Filter::kNearest;
      ExpectAgreement(scene);
    }
  }
}

TEST_F(PreviewTest, MipLevelsLeaveMagnifiedTexelsAsTheyAre) {
  const Dressing dressing = RandomDressing(SkewedGrid(4, 0.3, 7), 8);
  const TileSet tile_set = RandomTileSet(RandomBtfels(50, 9, 4, 2), 16, 3);
  const auto mips = MakeTileMips(tile_set, {}, run_);
  ASSERT_TRUE(mips.ok());
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = kWidth, .height = kHeight};
  scene.camera.eye = {0.1, 0.05, 1.2};
  const auto without = RenderReference(scene, run_);
  scene.mips = &*mips;
  const auto with = RenderReference(scene, run_);
  ASSERT_TRUE(without.ok() && with.ok());
  EXPECT_EQ(with->pixels, without->pixels);
}

// Noise from far away: what four samples a pixel show of it changes from pixel to pixel.
TEST_F(PreviewTest, MipLevelsKeepFarObjectsFromAliasing) {
  const Dressing dressing = RandomDressing(SkewedGrid(4, 0.1, 7), 8);
  const TileSet tile_set = RandomTileSet(RandomBtfels(50, 4, 4, 2), 64, 3);
  const auto mips = MakeTileMips(tile_set, {}, run_);
  ASSERT_TRUE(mips.ok());
  constexpr int kFiner = 8;
  // Four and eight texels a pixel, and more along the slope.
  for (const int height : {32, 16}) {
    PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = height, .height = height};
    scene.camera.eye = {1.2, 0.0, 3.0};
    scene.camera.fov_y_rad = 0.3;
    PreviewScene fine = scene;
    fine.width *= kFiner;
    fine.height *= kFiner;
    const auto supersampled = RenderGl(*context_, fine, run_);
    const auto without = RenderGl(*context_, scene, run_);
    scene.mips = &*mips;
    const auto with = RenderGl(*context_, scene, run_);
    ASSERT_TRUE(supersampled.ok() && without.ok() && with.ok());
    double squares_without = 0.0;
    double squares_with = 0.0;
    for (int y = 0; y < scene.height; ++y) {
      for (int x = 0; x < scene.width; ++x) {
        double mean = 0.0;
        for (int i = 0; i < kFiner * kFiner; ++i) {
          mean += supersampled->at(x * kFiner + i % kFiner, y * kFiner + i / kFiner)[1] / (kFiner * kFiner);
        }
        squares_without += std::pow(without->at(x, y)[1] - mean, 2);
        squares_with += std::pow(with->at(x, y)[1] - mean, 2);
      }
    }
    EXPECT_LT(squares_with, 0.15 * squares_without) << height;
  }
}

TEST_F(PreviewTest, GlMatchesTheReferenceFromInsideASolid) {
  const auto mesh = BuiltinShape("cube-sphere");
  ASSERT_TRUE(mesh.ok());
  Dressing dressing = RandomDressing(*mesh, 1);
  // Turned inside out: faces and normals look at the eye in the middle.
  for (size_t i = 0; i < dressing.mesh.quads.size(); ++i) {
    std::swap(dressing.mesh.quads[i][1], dressing.mesh.quads[i][3]);
  }
  for (Eigen::Vector3f& normal : dressing.mesh.normals) {
    normal = -normal;
  }
  const TileSet tile_set = RandomTileSet(RandomBtfels(50, 9, 9, 2), 16, 3);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 32, .height = 24};
  scene.camera.eye = {0.1, 0.05, 0.2};
  scene.camera.target = {0.3, 0.2, -1.0};
  scene.lights = {{.kind = Light::Kind::kPoint, .place = {0.2, 0.1, 0.3}}};
  const ReferencePicture reference = ExpectAgreement(scene);
  EXPECT_EQ(reference.image.at(16, 12)[3], 1.0f);
}

TEST_F(PreviewTest, AWhiteDiffuserReadsOneWhenLitAlongItsNormal) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.0, 1), 2);
  const TileSet tile_set = RandomTileSet(WhiteDiffuser(), 16, 3);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 64, .height = 48};
  scene.camera.eye = {0.2, -0.6, 3.0};
  scene.lights = {{.place = {0.0, 0.0, 5.0}}};
  for (const bool is_gl : {true, false}) {
    const auto image = is_gl ? RenderGl(*context_, scene, run_) : RenderReference(scene, run_);
    ASSERT_TRUE(image.ok()) << image.status();
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(image->at(32, 24)[c], 1.0f, 1e-4f);
    }
    EXPECT_EQ(image->at(32, 24)[3], 1.0f);
    EXPECT_EQ(image->at(0, 0)[3], 0.0f);
  }
  // Irradiance of the point light on the middle: pi / 2^2.
  scene.lights = {{.kind = Light::Kind::kPoint, .place = {0.0, 0.0, 2.0}}};
  scene.camera.eye = {0.0, 0.0, 3.0};
  const auto image = RenderGl(*context_, scene, run_);
  ASSERT_TRUE(image.ok());
  EXPECT_NEAR(image->at(32, 24)[1], 0.25f, 1e-3f);
}

// As an environment is shown: a list of directional lights.
TEST_F(PreviewTest, AThousandLightsAddUp) {
  const Dressing dressing = RandomDressing(SkewedGrid(2, 0.2, 1), 2);
  const TileSet tile_set = RandomTileSet(RandomBtfels(9, 4, 4, 5), 16, 3);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 24, .height = 16};
  scene.lights.clear();
  for (int i = 0; i < 1000; ++i) {
    scene.lights.push_back({.place = VectorFromDirection({1.5 * std::sqrt(i / 1000.0), 2.4 * i}),
                            .irradiance = Eigen::Vector3d::Constant(kPi / 1000.0)});
  }
  ExpectAgreement(scene);
  scene.lights.resize(4097);
  EXPECT_THAT(std::string(RenderGl(*context_, scene, run_).status().message()), HasSubstr("4097 lights"));
}

TEST_F(PreviewTest, TheBackOfASurfaceIsBlackAndCovers) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.0, 1), 2);
  const TileSet tile_set = RandomTileSet(WhiteDiffuser(), 16, 3);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 64, .height = 48};
  scene.camera.eye = {0.0, 0.0, -3.0};
  scene.lights = {{.place = {0.0, 0.0, -1.0}}, {.place = {0.0, 0.0, 1.0}}};
  for (const bool is_gl : {true, false}) {
    const auto image = is_gl ? RenderGl(*context_, scene, run_) : RenderReference(scene, run_);
    ASSERT_TRUE(image.ok()) << image.status();
    EXPECT_EQ(image->at(32, 24)[0], 0.0f);
    EXPECT_EQ(image->at(32, 24)[3], 1.0f);
  }
}

TEST_F(PreviewTest, EdgesAreAntialiasedByFourSamples) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.0, 1), 2);
  const TileSet tile_set = RandomTileSet(WhiteDiffuser(), 16, 3);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 96, .height = 64};
  scene.camera.eye = {0.3, 0.2, 4.0};
  scene.camera.up = {0.2, 1.0, 0.0};
  scene.lights = {{.place = {0.0, 0.0, 1.0}}};
  const auto image = RenderGl(*context_, scene, run_);
  const auto reference = RenderReference(scene, run_);
  ASSERT_TRUE(image.ok() && reference.ok());
  int partial = 0;
  int differ = 0;
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      const float alpha = image->at(x, y)[3];
      EXPECT_EQ(alpha * 4.0f, std::round(alpha * 4.0f));
      partial += alpha > 0.0f && alpha < 1.0f ? 1 : 0;
      differ += alpha != reference->at(x, y)[3] ? 1 : 0;
      // Coverage does not darken what is covered.
      if (alpha > 0.0f) {
        EXPECT_NEAR(image->at(x, y)[0], 1.0f, 1e-3f);
      }
    }
  }
  EXPECT_GT(partial, 60);
  // GL snaps vertices to 1/256 of a pixel, so a few samples on the very edge may fall either way.
  EXPECT_LT(differ, partial / 10 + 1);
}

TEST_F(PreviewTest, NoLightsLeaveOnlyCoverage) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.0, 1), 2);
  const TileSet tile_set = RandomTileSet(WhiteDiffuser(), 16, 3);
  const PreviewScene scene{
      .dressing = &dressing, .tile_set = &tile_set, .lights = {}, .width = 64, .height = 48};
  const auto image = RenderGl(*context_, scene, run_);
  ASSERT_TRUE(image.ok());
  EXPECT_EQ(image->at(32, 24)[0], 0.0f);
  EXPECT_EQ(image->at(32, 24)[3], 1.0f);
}

TEST_F(PreviewTest, LargePicturesAreDrawnInBands) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.2, 1), 2);
  const TileSet tile_set = RandomTileSet(RandomBtfels(9, 1, 1, 5), 16, 3);
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 8192, .height = 300};
  scene.camera.fov_y_rad = RadFromDeg(4.0);
  std::vector<uint64_t> rows;
  RunContext run;
  run.progress = [&](const Progress& p) { rows.push_back(p.done); };
  const auto image = RenderGl(*context_, scene, run);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_GT(rows.size(), 2u);
  EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
  EXPECT_EQ(rows.back(), 300u);
  // Rows 127 and 128 belong to two bands of the same picture.
  for (int x = 3000; x < 5000; x += 100) {
    EXPECT_NEAR(image->at(x, 127)[0], image->at(x, 128)[0], 0.2f);
    EXPECT_EQ(image->at(x, 128)[3], 1.0f);
  }
}

TEST_F(PreviewTest, StopsWhenAsked) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.2, 1), 2);
  const TileSet tile_set = RandomTileSet(RandomBtfels(9, 4, 4, 5), 16, 3);
  const PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 1024, .height = 1024};
  std::stop_source stop;
  RunContext run;
  run.stop = stop.get_token();
  int reports = 0;
  run.progress = [&](const Progress&) {
    ++reports;
    stop.request_stop();
  };
  EXPECT_EQ(RenderGl(*context_, scene, run).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(reports, 1);
  EXPECT_EQ(RenderReference(scene, run).status().code(), absl::StatusCode::kCancelled);
}

TEST_F(PreviewTest, TheSameSceneGivesTheSameBytes) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.2, 1), 2);
  const TileSet tile_set = RandomTileSet(RandomBtfels(9, 9, 4, 5), 16, 3);
  const PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 100, .height = 80};
  const auto first = RenderGl(*context_, scene, run_);
  const auto again = RenderGl(*context_, scene, run_);
  ASSERT_TRUE(first.ok() && again.ok());
  EXPECT_EQ(first->pixels, again->pixels);
}

TEST_F(PreviewTest, APreparedPreviewDrawsWhatItsScenesAskFor) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.2, 1), 2);
  const TileSet tile_set = RandomTileSet(RandomBtfels(9, 9, 4, 5), 16, 3);
  const TileSet other = RandomTileSet(RandomBtfels(9, 4, 4, 6), 16, 3);
  const auto preview = GlPreview::Create(*context_, dressing, tile_set);
  const auto beside = GlPreview::Create(*context_, dressing, other);
  ASSERT_TRUE(preview.ok() && beside.ok());
  PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 100, .height = 80};
  for (int round = 0; round < 2; ++round) {
    for (const Filter filter : {Filter::kBilinear, Filter::kNearest}) {
      scene.filter = filter;
      scene.width += 7;
      scene.camera.eye.x() += 0.1;
      const auto image = (*preview)->Render(scene, run_);
      const auto expected = RenderGl(*context_, scene, run_);
      ASSERT_TRUE(image.ok() && expected.ok());
      EXPECT_EQ(image->pixels, expected->pixels);
      EXPECT_GT(*std::max_element(image->pixels.begin(), image->pixels.end()), 0.2f);
    }
  }
  EXPECT_EQ((*beside)->Render(scene, run_).status().code(), absl::StatusCode::kInvalidArgument);
  const auto mips = MakeTileMips(tile_set, {}, run_);
  ASSERT_TRUE(mips.ok());
  scene.mips = &*mips;
  EXPECT_EQ((*preview)->Render(scene, run_).status().code(), absl::StatusCode::kInvalidArgument);
  scene.mips = nullptr;
  scene.tile_set = &other;
  EXPECT_EQ((*preview)->Render(scene, run_).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE((*beside)->Render(scene, run_).ok());
}

TEST_F(PreviewTest, AContextMayServeSeveralThreadsInTurnAndTwoContextsTwoThreadsAtOnce) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.2, 1), 2);
  const TileSet tile_set = RandomTileSet(RandomBtfels(9, 9, 4, 5), 16, 3);
  const PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set, .width = 100, .height = 80};
  const auto expected = RenderGl(*context_, scene, run_);
  ASSERT_TRUE(expected.ok());
  std::vector<std::thread> threads;
  std::vector<Image> images(2);
  for (int i = 0; i < 2; ++i) {
    threads.emplace_back([&, i] {
      // The first thread takes over the context that this thread used before.
      auto own = CreateOsmesaContext();
      OffscreenContext& context = i == 0 ? *context_ : **own;
      for (int round = 0; round < 3; ++round) {
        auto image = RenderGl(context, scene, run_);
        if (image.ok()) {
          images[i] = *std::move(image);
        }
      }
    });
  }
  for (std::thread& thread : threads) {
    thread.join();
  }
  EXPECT_EQ(images[0].pixels, expected->pixels);
  EXPECT_EQ(images[1].pixels, expected->pixels);
  EXPECT_THAT(context_->Description(), HasSubstr("4.5"));
}

TEST_F(PreviewTest, RefusesBadScenesByName) {
  const Dressing dressing = RandomDressing(SkewedGrid(3, 0.0, 1), 2);
  const TileSet tile_set = RandomTileSet(WhiteDiffuser(), 16, 3);
  const PreviewScene good{.dressing = &dressing, .tile_set = &tile_set, .width = 32, .height = 32};
  const auto expect = [&](const PreviewScene& scene, absl::StatusCode code, const char* word) {
    for (const absl::Status& status :
         {RenderGl(*context_, scene, run_).status(), RenderReference(scene, run_).status()}) {
      EXPECT_EQ(status.code(), code) << status;
      EXPECT_THAT(std::string(status.message()), HasSubstr(word));
    }
  };
  const auto invalid = absl::StatusCode::kInvalidArgument;
  PreviewScene scene = good;
  scene.width = 0;
  expect(scene, invalid, "width: 0");
  scene = good;
  scene.height = 8193;
  expect(scene, invalid, "height: 8193");
  scene = good;
  scene.camera.eye.x() = std::nan("");
  expect(scene, invalid, "camera eye");
  scene = good;
  scene.camera.target = scene.camera.eye;
  expect(scene, invalid, "same point");
  scene = good;
  scene.camera.fov_y_rad = 4.0;
  expect(scene, invalid, "field of view");
  scene = good;
  scene.lights[0].place.setZero();
  expect(scene, invalid, "light 0");
  scene = good;
  scene.lights[0].irradiance.y() = -1.0;
  expect(scene, invalid, "negative");
  scene = good;
  scene.tile_set = nullptr;
  expect(scene, invalid, "no dressing or no tile set");
  Dressing other = dressing;
  other.arrangement_id = "plane-16";
  scene = good;
  scene.dressing = &other;
  expect(scene, absl::StatusCode::kFailedPrecondition, "plane-16");
  TileSet foreign = tile_set;
  foreign.btfels.codec_id = "dfmf-x";
  scene = good;
  scene.tile_set = &foreign;
  expect(scene, absl::StatusCode::kUnimplemented, "dfmf-x");
}

}  // namespace
}  // namespace tessera
