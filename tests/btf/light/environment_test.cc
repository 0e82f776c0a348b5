#include "btf/light/environment.h"

#include <cmath>
#include <fstream>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/image/image_io.h"
#include "tests/btf/light/environments.h"
#include "tests/btf/light/random_rotation.h"
#include "tests/support/image_files.h"
#include "tests/support/temp_folder.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

constexpr EnvironmentLayout kLayouts[] = {EnvironmentLayout::kEquirect, EnvironmentLayout::kAngular};

Eigen::Array3d Linear(const Eigen::Vector3d& d) {
  return {2.0 + d.x(), 3.0 + 2.0 * d.y(), 4.0 - 3.0 * d.z()};
}

Eigen::Array3d One(const Eigen::Vector3d& /*direction*/) {
  return Eigen::Array3d::Ones();
}

std::string Refusal(const Image& image, const EnvironmentOptions& options = {}) {
  const auto environment = Environment::Create(image, "probe", options);
  EXPECT_EQ(environment.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(environment.status().message());
}

TEST(EnvironmentTest, LooksUpWhatLiesInADirection) {
  Rng rng(1);
  for (const EnvironmentLayout layout : kLayouts) {
    const Environment environment = EnvironmentOf(layout, 90, Linear);
    const Environment constant = EnvironmentOf(layout, 9, One);
    const Environment odd = *Environment::Create(Image(7, 5, 1), "odd", {EnvironmentLayout::kEquirect});
    for (int i = 0; i < 2000; ++i) {
      // The axes, where seam, poles and rim are, and near them.
      Eigen::Vector3d d = i < 600 ? Eigen::Vector3d(Eigen::Vector3d::Unit(i % 3) * (i % 2 == 0 ? 1.0 : -1.0))
                                  : RandomDirection(rng);
      if (i >= 6 && i < 600) {
        d = (d + 0.01 * RandomDirection(rng)).normalized();
      }
      // Linear between centres 2 to 4 degrees apart; the angular map's rim is one direction drawn out.
      EXPECT_LT((environment.Radiance(d) - Linear(d)).abs().maxCoeff(), d.z() > 0.99 ? 0.15 : 5e-3)
          << d.transpose();
      EXPECT_LT((constant.Radiance(d) - 1.0).abs().maxCoeff(), 1e-12);
      EXPECT_EQ(odd.Radiance(d).maxCoeff(), 0.0);
    }
  }
}

TEST(EnvironmentTest, CrossesSeamAndPoles) {
  const Environment environment = EnvironmentOf(EnvironmentLayout::kEquirect, 90, Linear);
  for (const Eigen::Vector3d& d : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, 1, 0),
                                   Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(0, 0.999, 0.0447)}) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = 1e-6 * Eigen::Vector3d::Unit(axis);
      EXPECT_LT(
          (environment.Radiance((d + step).normalized()) - environment.Radiance((d - step).normalized()))
              .abs()
              .maxCoeff(),
          1e-4);
    }
    EXPECT_LT((environment.Radiance(d) - Linear(d)).abs().maxCoeff(), 3e-3);
  }
}

TEST(EnvironmentTest, TurnsAboutTheVerticalCounterClockwiseFromAbove) {
  Rng rng(2);
  for (const EnvironmentLayout layout : kLayouts) {
    const Environment plain = EnvironmentOf(layout, 60, Linear);
    const Environment turned = EnvironmentOf(layout, 60, Linear, {.rotation_rad = kPi / 2.0});
    EXPECT_LT((turned.Radiance({1, 0, 0}) - plain.Radiance({0, 0, 1})).abs().maxCoeff(), 0.2);
    EXPECT_LT((turned.Radiance({0, 0, -1}) - plain.Radiance({1, 0, 0})).abs().maxCoeff(), 1e-9);
    const Environment by_1 = EnvironmentOf(layout, 60, Linear, {.rotation_rad = 1.0});
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitY()).toRotationMatrix();
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d d = RandomDirection(rng);
      EXPECT_LT((by_1.Radiance(rotation * d) - plain.Radiance(d)).abs().maxCoeff(), 1e-9);
    }
    EXPECT_LT((by_1.TexelDirection(20, 33) - rotation * plain.TexelDirection(20, 33)).norm(), 1e-15);
    EXPECT_TRUE((by_1.power() == plain.power()).all());
  }
}

TEST(EnvironmentTest, PowerIsTheIntegralOfRadiance) {
  for (const EnvironmentLayout layout : kLayouts) {
    const Environment constant = EnvironmentOf(layout, 50, One, {.scale = 2.5});
    EXPECT_LT((constant.power() / (10.0 * kPi) - 1.0).abs().maxCoeff(), 1e-13);
    EXPECT_LT((constant.MeanRadiance() - 2.5).abs().maxCoeff(), 1e-12);
    const Environment linear = EnvironmentOf(layout, 50, Linear);
    EXPECT_LT((linear.MeanRadiance() - Eigen::Array3d(2, 3, 4)).abs().maxCoeff(), 2e-3);
  }
}

TEST(EnvironmentTest, ChoosesOrTakesTheLayout) {
  EXPECT_EQ(Environment::Create(Image(8, 4, 3), "a", {})->grid().layout(), EnvironmentLayout::kEquirect);
  EXPECT_EQ(Environment::Create(Image(8, 8, 3), "a", {})->grid().layout(), EnvironmentLayout::kAngular);
  EXPECT_EQ(Environment::Create(Image(8, 8, 3), "a", {EnvironmentLayout::kEquirect})->grid().layout(),
            EnvironmentLayout::kEquirect);
  EXPECT_THAT(Refusal(Image(8, 5, 3)), HasSubstr("probe: 8x5 texels, expected 2:1"));
  EXPECT_THAT(Refusal(Image(8, 4, 3), {EnvironmentLayout::kAngular}),
              HasSubstr("8x4 texels, an angular map"));
}

TEST(EnvironmentTest, RefusesWhatIsNoRadianceByPlaceAndValue) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Image image(8, 4, 3);
  image.at(5, 2)[1] = -0.25F;
  EXPECT_THAT(Refusal(image), HasSubstr("probe: green of texel (5, 2) is -0.25"));
  image.at(5, 2)[1] = kNan;
  EXPECT_THAT(Refusal(image), HasSubstr("green of texel (5, 2) is nan"));
  image.at(5, 2)[1] = 0.0F;
  image.at(7, 3)[2] = kInfinity;
  EXPECT_THAT(Refusal(image), HasSubstr("blue of texel (7, 3) is inf"));
  // Outside an angular map's rim there is nothing.
  Image probe(16, 16, 3);
  probe.at(0, 0)[0] = kNan;
  EXPECT_TRUE(Environment::Create(probe, "probe", {}).ok());
  probe.at(0, 8)[0] = kNan;
  EXPECT_THAT(Refusal(probe), HasSubstr("red of texel (0, 8) is nan"));
  for (const double bad : {0.0, -1.0, static_cast<double>(kNan), static_cast<double>(kInfinity)}) {
    EXPECT_THAT(Refusal(Image(8, 4, 3), {.scale = bad}), HasSubstr("scale"));
  }
  EXPECT_THAT(Refusal(Image(8, 4, 3), {.rotation_rad = kInfinity}), HasSubstr("rotation"));
  EXPECT_THAT(Refusal(Image(8, 4, 2)), HasSubstr("2 channels"));
  EXPECT_THAT(Refusal(Image()), HasSubstr("0x0"));
  Image too_large;
  too_large.width = 1 << 30;
  too_large.height = 1 << 29;
  EXPECT_THAT(Refusal(too_large), HasSubstr("samples"));
}

TEST(EnvironmentTest, TakesGreyAndLeavesAlphaOut) {
  Image grey(2, 1, 1);
  grey.pixels = {1.0F, 2.0F};
  EXPECT_TRUE((Environment::Create(grey, "a", {})->TexelRadiance(1, 0) == 2.0).all());
  Image with_alpha(2, 1, 4);
  with_alpha.pixels = {1, 2, 3, -5, 4, 5, 6, -5};
  EXPECT_TRUE(
      (Environment::Create(with_alpha, "a", {})->TexelRadiance(1, 0) == Eigen::Array3d(4, 5, 6)).all());
}

TEST(EnvironmentTest, ReadsFilesOfBothKinds) {
  const TempFolder folder;
  const Image image = PictureOf(EnvironmentLayout::kEquirect, 8, SunnySky);
  std::ofstream(folder.path() / "sky.exr", std::ios::binary) << *EncodeExr(image, ExrDepth::kFloat);
  const auto exr = ReadEnvironment(folder.path() / "sky.exr", {});
  ASSERT_TRUE(exr.ok()) << exr.status();
  EXPECT_FLOAT_EQ(exr->TexelRadiance(3, 2)[0], image.at(3, 2)[0]);
  std::ofstream(folder.path() / "sky.hdr", std::ios::binary)
      << MakeRadiance(CodeImage(4, 4, 4), RadianceLayout::kPlain);
  EXPECT_TRUE(ReadEnvironment(folder.path() / "sky.hdr", {}).ok());
  std::ofstream(folder.path() / "large.hdr", std::ios::binary) << "#?RADIANCE\n\n-Y 16384 +X 16384\n";
  const auto large = ReadEnvironment(folder.path() / "large.hdr", {});
  EXPECT_EQ(large.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(large.status().message()), HasSubstr("at most 33554432"));
  EXPECT_EQ(ReadEnvironment(folder.path() / "none.hdr", {}).status().code(), absl::StatusCode::kNotFound);
}

TEST(EnvironmentTest, MeasuredEnvironmentsAreAsTheirSourceSays) {
  TESSERA_REQUIRE_DATA("hdr/venice.hdr");
  const auto venice = ReadEnvironment(TestData("hdr/venice.hdr"), {});
  const auto studio = ReadEnvironment(TestData("hdr/studio.hdr"), {});
  ASSERT_TRUE(venice.ok() && studio.ok()) << venice.status() << studio.status();
  const auto largest = [](const Environment& environment) {
    double value = 0.0;
    for (int i = 0; i < 512 * 256; ++i) {
      value = std::max(value, environment.TexelRadiance(i % 512, i / 512).maxCoeff());
    }
    return value;
  };
  EXPECT_NEAR(largest(*venice), 8.6, 0.05);
  EXPECT_NEAR(largest(*studio), 3730.0, 20.0);
  // Sky over sea.
  EXPECT_GT(venice->Radiance({0, 1, 0}).mean(), 2.0 * venice->Radiance({0, -1, 0}).mean());
}

}  // namespace
}  // namespace tessera
