// Light in the frequency domain against sums over directions, for every codec.
#include "btf/light/frequency_light.h"

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/codec/dsh/dsh_decoder.h"
#include "btf/light/environment_reference.h"
#include "btf/light/sh_rotation.h"
#include "btf/math/hemisphere_gram.h"
#include "btf/math/spherical_harmonics.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/light/environments.h"
#include "tests/btf/light/random_rotation.h"
#include "tests/support/codecs.h"

namespace tessera {
namespace {

constexpr EnvironmentLayout kBothLayouts[] = {EnvironmentLayout::kEquirect, EnvironmentLayout::kAngular};

Eigen::MatrixXd Project(const Environment& environment, int n, ShWindow window = ShWindow::kNone) {
  auto coefficients = ProjectEnvironment(environment, n, window);
  EXPECT_TRUE(coefficients.ok()) << coefficients.status();
  return *std::move(coefficients);
}

Eigen::VectorXd Harmonics(const Eigen::Vector3d& d, int n) {
  Eigen::VectorXd y(n);
  EvaluateSh(d, std::span(y.data(), static_cast<size_t>(n)));
  return y;
}

// The midpoint rule in cosine and azimuth; not the nodes of the code under test. Each stands for 2 pi / size.
std::vector<Eigen::Vector3d> FineHemisphere() {
  constexpr int kPolar = 110;
  constexpr int kAzimuths = 110;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < kPolar; ++i) {
    for (int j = 0; j < kAzimuths; ++j) {
      points.push_back(
          VectorFromDirection({std::acos((i + 0.5) / kPolar), 2.0 * kPi * (j + 0.37 * (i % 3)) / kAzimuths}));
    }
  }
  return points;
}

TEST(ProjectEnvironmentTest, ConstantLightIsTheFirstHarmonicAlone) {
  for (const EnvironmentLayout layout : kBothLayouts) {
    const double tolerance = layout == EnvironmentLayout::kEquirect ? 1e-13 : 1e-5;
    for (const int height : {1, 4, 64}) {
      const Eigen::MatrixXd c = Project(
          EnvironmentOf(layout, height, [](const Eigen::Vector3d&) { return Eigen::Array3d(1, 2, 3); }), 49);
      EXPECT_LT((c.row(0) - std::sqrt(4.0 * kPi) * Eigen::RowVector3d(1, 2, 3)).cwiseAbs().maxCoeff(), 1e-11);
      EXPECT_LT(c.bottomRows(48).cwiseAbs().maxCoeff(), 3.0 * tolerance) << height;
    }
  }
}

TEST(ProjectEnvironmentTest, FindsEveryHarmonic) {
  for (const EnvironmentLayout layout : kBothLayouts) {
    for (const int harmonic : {1, 2, 3, 4, 7, 12, 20, 30, 40, 48}) {
      const Environment environment = EnvironmentOf(layout, 180, [&](const Eigen::Vector3d& d) {
        return Eigen::Array3d::Constant(2.0 + Harmonics(d, 49)[harmonic]);
      });
      Eigen::VectorXd expected = Eigen::VectorXd::Zero(49);
      expected[0] = 2.0 * std::sqrt(4.0 * kPi);
      expected[harmonic] = 1.0;
      EXPECT_LT((Project(environment, 49).col(1) - expected).cwiseAbs().maxCoeff(), 3e-3) << harmonic;
    }
  }
}

TEST(ProjectEnvironmentTest, IsExactOverTexels) {
  // The same light in four times as many texels is the same light.
  for (const EnvironmentLayout layout : kBothLayouts) {
    const Image coarse = PictureOf(layout, 8, SunnySky);
    Image fine(2 * coarse.width, 2 * coarse.height, 3);
    for (int y = 0; y < fine.height; ++y) {
      for (int x = 0; x < fine.width; ++x) {
        std::copy_n(coarse.at(x / 2, y / 2), 3, fine.at(x, y));
      }
    }
    const Eigen::MatrixXd a = Project(*Environment::Create(coarse, "coarse", {}), 49);
    const Eigen::MatrixXd b = Project(*Environment::Create(fine, "fine", {}), 49);
    EXPECT_LT((a - b).cwiseAbs().maxCoeff() / a.cwiseAbs().maxCoeff(), 1e-13);
    // And that of a sum over points within the texels.
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(49, 3);
    const Environment environment = *Environment::Create(coarse, "coarse", {});
    constexpr int kCuts = 24;
    const TexelGrid points(layout, coarse.width * kCuts, coarse.height * kCuts);
    for (int y = 0; y < points.height(); ++y) {
      for (int x = 0; x < points.width(); ++x) {
        sum += points.SolidAngle(x, y) * Harmonics(points.Direction(x, y), 49) *
               environment.TexelRadiance(x / kCuts, y / kCuts).matrix().transpose();
      }
    }
    EXPECT_LT((a - sum).cwiseAbs().maxCoeff() / a.cwiseAbs().maxCoeff(), 2e-3);
  }
}

TEST(ProjectEnvironmentTest, TurnsWithTheEnvironment) {
  for (const EnvironmentLayout layout : kBothLayouts) {
    const Environment plain = EnvironmentOf(layout, 32, SunnySky);
    const Environment turned = EnvironmentOf(layout, 32, SunnySky, {.rotation_rad = 2.0, .scale = 2.0});
    const Eigen::MatrixXd expected =
        2.0 * ShRotation(turned.world_from_picture(), 4).Apply(Project(plain, 25));
    EXPECT_LT((Project(turned, 25) - expected).cwiseAbs().maxCoeff(), 1e-10);
  }
}

TEST(ProjectEnvironmentTest, WindowsOnlyWhenAsked) {
  const Environment environment = EnvironmentOf(EnvironmentLayout::kEquirect, 16, SunnySky);
  const Eigen::MatrixXd plain = Project(environment, 25);
  const Eigen::MatrixXd windowed = Project(environment, 25, ShWindow::kLanczos);
  EXPECT_EQ(windowed.row(0), plain.row(0));
  for (int l = 1; l <= 4; ++l) {
    const double x = kPi * l / 5.0;
    EXPECT_LT((windowed.middleRows(l * l, 2 * l + 1) - std::sin(x) / x * plain.middleRows(l * l, 2 * l + 1))
                  .cwiseAbs()
                  .maxCoeff(),
              1e-12);
  }
  EXPECT_EQ(ProjectEnvironment(environment, 24).status().code(), absl::StatusCode::kInvalidArgument);
}

Material Encode(const std::string& codec, double max_theta_deg) {
  SampledBtf btf = ShinyBtf(3, 2, RingDirections(4, 9, max_theta_deg), RingDirections(5, 11, max_theta_deg));
  auto material = FindCodec(codec)->Encode(btf, {.kl = 16, .kv = 9, .eigen_textures = 3, .rank = 6}, {});
  EXPECT_TRUE(material.ok()) << material.status();
  return *std::move(material);
}

std::vector<double> Btfel(const Material& material, const Decoder& decoder, int texel) {
  std::vector<double> coefficients(material.btfels.num_coefficients);
  decoder.Dequantize(material.btfels.btfel(texel), coefficients);
  return coefficients;
}

// Frames at the rotation's poles, close to them, and anywhere.
std::vector<Eigen::Matrix3d> Frames() {
  const auto turn = [](double angle, int axis) {
    return Eigen::AngleAxisd(angle, Eigen::Vector3d::Unit(axis)).toRotationMatrix();
  };
  Rng rng(11);
  return {turn(0, 0),     turn(kPi / 2, 0),    turn(kPi, 1),       turn(kPi - 1e-9, 0),
          turn(1e-12, 1), RandomRotation(rng), RandomRotation(rng)};
}

std::vector<Eigen::Vector3d> Views() {
  return {{0, 0, 1}, VectorFromDirection({0.9, 2.0}), VectorFromDirection({RadFromDeg(88.0), 4.0})};
}

class FrequencyLightTest : public ::testing::TestWithParam<std::string> {};

TEST_P(FrequencyLightTest, IsTheIntegralOfTheSameBandLimitedLight) {
  constexpr double kRelativeRmse = 1e-3;
  const Environment environment = EnvironmentOf(EnvironmentLayout::kEquirect, 32, SunnySky);
  const std::vector<Eigen::Vector3d> lights = FineHemisphere();
  for (const double max_theta_deg : {75.0, 90.0}) {
    const Material material = Encode(GetParam(), max_theta_deg);
    const auto decoder = *MakeDecoder(material.btfels);
    const std::vector<double> c = Btfel(material, *decoder, 4);
    std::array<double, 3> error{};
    std::array<double, 3> size{};
    constexpr std::array<int, 3> kCounts = {9, 25, 49};
    int turns = 0;
    for (const Eigen::Matrix3d& frame : Frames()) {
      const Eigen::Vector3d view = Views()[turns % 3];
      Eigen::Matrix3Xd values(3, lights.size());
      Eigen::MatrixXd harmonics(49, lights.size());  // in the world
      for (size_t i = 0; i < lights.size(); ++i) {
        values.col(i) =
            decoder->Evaluate(c, UnturnedFromTurned(lights[i], turns), UnturnedFromTurned(view, turns));
        harmonics.col(i) = Harmonics(frame.transpose() * lights[i], 49);
      }
      for (size_t k = 0; k < kCounts.size(); ++k) {
        const FrequencyLight light = *FrequencyLight::Create(environment, kCounts[k]);
        const Eigen::Matrix3Xd radiance = light.coefficients().transpose() * harmonics.topRows(kCounts[k]);
        const Eigen::Array3d sum =
            (values.array() * radiance.array()).rowwise().sum() * (2.0 / static_cast<double>(lights.size()));
        const LinearForm form = RadianceForm(*decoder, view, light.InFrame(frame), turns);
        error[k] += (form.ValueOf(c) - sum).square().sum();
        size[k] += sum.square().sum();
      }
      ++turns;
    }
    for (size_t k = 0; k < kCounts.size(); ++k) {
      EXPECT_GT(size[k], 1.0);
      EXPECT_LT(std::sqrt(error[k] / size[k]), kRelativeRmse) << kCounts[k] << ' ' << max_theta_deg;
      RecordProperty(
          "relative_rmse_" + std::to_string(kCounts[k]) + "_" + std::to_string(lround(max_theta_deg)),
          testing::PrintToString(std::sqrt(error[k] / size[k])));
    }
  }
}

TEST_P(FrequencyLightTest, IsWhatEveryTexelOfASmoothEnvironmentGives) {
  // Light of 9 harmonics in texels of 6 degrees: what the texels leave.
  const auto smooth = [](const Eigen::Vector3d& d) {
    return Eigen::Array3d(2.0 + d.x(), 2.0 + d.y() * d.z(), 2.0 - d.z() + d.x() * d.y());
  };
  const Material material = Encode(GetParam(), 75.0);
  const auto decoder = *MakeDecoder(material.btfels);
  const std::vector<double> c = Btfel(material, *decoder, 1);
  for (const EnvironmentLayout layout : kBothLayouts) {
    const Environment environment = EnvironmentOf(layout, 64, smooth, {.rotation_rad = 0.4});
    const FrequencyLight light = *FrequencyLight::Create(environment, 9);
    const Eigen::Matrix3d frame = Frames()[5];
    const Eigen::Vector3d view = Views()[1];
    const Eigen::Array3d brute =
        EnvironmentRadiance(environment, *decoder, c, view, frame, 3, NegativeValues::kKeep);
    const Eigen::Array3d fast = RadianceForm(*decoder, view, light.InFrame(frame), 3).ValueOf(c);
    EXPECT_LT((fast - brute).abs().maxCoeff(), 3e-3 * brute.abs().maxCoeff());
    const Eigen::Array3d clamped =
        EnvironmentRadiance(environment, *decoder, c, view, frame, 3, NegativeValues::kClamp);
    EXPECT_GE((clamped - brute).minCoeff(), 0.0);
  }
}

TEST_P(FrequencyLightTest, ShowsNothingFromBelow) {
  const Material material = Encode(GetParam(), 75.0);
  const auto decoder = *MakeDecoder(material.btfels);
  const LinearForm form = RadianceForm(*decoder, {1, 0, 0}, Eigen::MatrixXd::Ones(9, 3), 0);
  EXPECT_TRUE(form.runs.empty());
}

INSTANTIATE_TEST_SUITE_P(AllCodecs, FrequencyLightTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);

TEST(FrequencyLightEquationTest, IsEquation1AsPrinted) {
  // "dsh-cls" measured down to the horizon: c_rho(v)^T A R c_e, with A of eq. 2.
  const Material material = Encode("dsh-cls", 90.0);
  const auto decoder = *DshDecoder::Create(material.btfels);
  const std::vector<double> c = Btfel(material, *decoder, 3);
  const HemisphereQuadrature hemisphere = MakeHemisphereQuadrature(6);
  const Eigen::MatrixXd a = GramMatrix(ShMatrix(16, hemisphere.directions), hemisphere.weights);
  const Environment environment = EnvironmentOf(EnvironmentLayout::kEquirect, 32, SunnySky);
  const FrequencyLight light = *FrequencyLight::Create(environment, 16);
  for (const Eigen::Matrix3d& frame : Frames()) {
    for (const Eigen::Vector3d& view : Views()) {
      Eigen::VectorXd view_weights(9);
      decoder->ViewWeights(view, std::span(view_weights.data(), 9));
      const Eigen::MatrixXd rotated = ShRotation(frame, 3).Matrix() * light.coefficients();
      Eigen::Array3d expected;
      for (int channel = 0; channel < 3; ++channel) {
        const Eigen::MatrixXd of_channel =
            Eigen::Map<const Eigen::MatrixXd>(c.data() + channel * 16 * 9, 16, 9);  // [light][view]
        expected[channel] = (of_channel * view_weights).dot(a * rotated.col(channel)) / kPi;
      }
      const Eigen::Array3d value = RadianceForm(*decoder, view, light.InFrame(frame), 0).ValueOf(c);
      EXPECT_LT((value - expected).abs().maxCoeff(), 1e-9 * expected.abs().maxCoeff());
    }
  }
}

TEST(FrequencyLightEquationTest, OneVectorOfLightServesEveryView) {
  const Material material = Encode("dsh", 75.0);
  const auto decoder = *DshDecoder::Create(material.btfels);
  const std::vector<double> c = Btfel(material, *decoder, 2);
  const FrequencyLight light =
      *FrequencyLight::Create(EnvironmentOf(EnvironmentLayout::kEquirect, 8, SunnySky), 25);
  const Eigen::MatrixXd in_frame = light.InFrame(Frames()[5]);
  const Eigen::MatrixXd vectors = decoder->LightIntegrals().leftCols(25) * in_frame;
  ASSERT_EQ(vectors.rows(), 16);
  for (const Eigen::Vector3d& view : Views()) {
    Eigen::VectorXd view_weights(9);
    decoder->ViewWeights(view, std::span(view_weights.data(), 9));
    const Eigen::Array3d value = RadianceForm(*decoder, view, in_frame, 0).ValueOf(c);
    for (int channel = 0; channel < 3; ++channel) {
      const Eigen::Map<const Eigen::MatrixXd> of_channel(c.data() + channel * 16 * 9, 16, 9);
      EXPECT_NEAR(vectors.col(channel).dot(of_channel * view_weights) / kPi, value[channel], 1e-10);
    }
  }
}

TEST(FrequencyLightEquationTest, AWhiteDiffuserReflectsItsIrradiance) {
  // Value cos(theta): radiance is irradiance / pi, and for constant light the light itself.
  SampledBtf btf(1, 1, RingDirections(4, 9, 90.0), RingDirections(10, 24, 90.0));
  for (size_t v = 0; v < btf.info().views.size(); ++v) {
    for (size_t l = 0; l < btf.info().lights.size(); ++l) {
      for (int channel = 0; channel < 3; ++channel) {
        btf.at(0, 0, channel, v, l) = static_cast<float>(std::cos(btf.info().lights[l].theta_rad));
      }
    }
  }
  const auto material = FindCodec("dsh")->Encode(btf, {.kl = 25, .kv = 1}, {});
  ASSERT_TRUE(material.ok()) << material.status();
  const auto decoder = *MakeDecoder(material->btfels);
  const std::vector<double> c = Btfel(*material, *decoder, 0);
  const FrequencyLight light =
      *FrequencyLight::Create(EnvironmentOf(EnvironmentLayout::kEquirect, 4,
                                            [](const Eigen::Vector3d&) { return Eigen::Array3d(1, 2, 3); }),
                              25);
  const Eigen::Array3d radiance = RadianceForm(*decoder, {0, 0, 1}, light.InFrame(Frames()[6]), 2).ValueOf(c);
  EXPECT_LT((radiance / Eigen::Array3d(1, 2, 3) - 1.0).abs().maxCoeff(), 0.01);
}

}  // namespace
}  // namespace tessera
