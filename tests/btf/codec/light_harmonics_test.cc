// The light side of every codec in spherical harmonics, against sums over many lights.
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/math/spherical_harmonics.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/support/codecs.h"

namespace tessera {
namespace {

double Environment(const std::vector<double>& harmonics, const Eigen::Vector3d& light) {
  Eigen::VectorXd y(static_cast<Eigen::Index>(harmonics.size()));
  EvaluateSh(light, std::span(y.data(), harmonics.size()));
  return y.dot(Eigen::Map<const Eigen::VectorXd>(harmonics.data(), y.size()));
}

// The midpoint rule in cosine and azimuth: slow, and not the nodes of the code under test.
Eigen::Array3d SlowIntegral(const Decoder& decoder, const std::vector<double>& coefficients,
                            const Eigen::Vector3d& view, const std::vector<double>& environment) {
  constexpr int kPolar = 160;
  constexpr int kAzimuths = 250;
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  for (int i = 0; i < kPolar; ++i) {
    const double z = (i + 0.5) / kPolar;
    for (int j = 0; j < kAzimuths; ++j) {
      const Eigen::Vector3d light = VectorFromDirection({std::acos(z), 2.0 * kPi * (j + 0.37) / kAzimuths});
      sum += decoder.Evaluate(coefficients, light, view) * Environment(environment, light);
    }
  }
  return sum * 2.0 * kPi / (kPolar * kAzimuths);
}

class LightHarmonicsTest : public ::testing::TestWithParam<std::string> {
 protected:
  static Material Encode(double max_theta_deg) {
    SampledBtf btf =
        ShinyBtf(3, 2, RingDirections(4, 9, max_theta_deg), RingDirections(5, 11, max_theta_deg));
    auto material =
        FindCodec(GetParam())->Encode(btf, {.kl = 16, .kv = 9, .eigen_textures = 3, .rank = 6}, {});
    EXPECT_TRUE(material.ok()) << material.status();
    return *std::move(material);
  }
};

TEST_P(LightHarmonicsTest, IntegratesTheExtendedFunctionAgainstAnyEnvironment) {
  // Of the largest integral: what the slow rule leaves at the kinks.
  constexpr double kTolerance = 1e-3;
  for (const double max_theta_deg : {75.0, 60.0, 90.0}) {
    const Material material = Encode(max_theta_deg);
    const auto decoder = *MakeDecoder(material.btfels);
    std::vector<double> c(material.btfels.num_coefficients);
    decoder->Dequantize(material.btfels.btfel(4), c);
    for (const int n : {1, 9, 25, 49}) {
      for (const Direction& view : {Direction{0.0, 0.0}, Direction{0.9, 2.0}, Direction{1.5, 5.0}}) {
        std::vector<double> environment(n);
        Rng rng(static_cast<uint64_t>(n));
        for (double& l : environment) {
          l = rng.NextDouble() - 0.5;
        }
        const Eigen::Vector3d eye = VectorFromDirection(view);
        const std::vector<LinearForm> forms = decoder->LightHarmonics(n, eye);
        ASSERT_EQ(forms.size(), static_cast<size_t>(n));
        Eigen::Array3d value = Eigen::Array3d::Zero();
        for (int i = 0; i < n; ++i) {
          value += environment[i] * forms[i].ValueOf(c);
        }
        const Eigen::Array3d slow = SlowIntegral(*decoder, c, eye, environment);
        EXPECT_LT((value - slow).abs().maxCoeff(), kTolerance)
            << n << ' ' << max_theta_deg << ' ' << view.theta_rad << ": " << value.transpose() << " against "
            << slow.transpose();
        if (n == 1) {
          EXPECT_GT(value.abs().maxCoeff(), 0.01);
        }
      }
    }
  }
}

TEST_P(LightHarmonicsTest, AConstantEnvironmentGivesTheHemisphereIntegral) {
  // A texture that reads 1 under every light and view: 2 pi, less what the cosine beyond 75 degrees takes,
  // c_l^2 / 2 of c_l.
  SampledBtf btf(2, 2, RingDirections(4, 9), RingDirections(5, 11));
  for (int texel = 0; texel < 4; ++texel) {
    for (size_t i = 0; i < 3 * btf.info().views.size() * btf.info().lights.size(); ++i) {
      (&btf.at(texel % 2, texel / 2, 0, 0, 0))[i] = 1.0F;
    }
  }
  const auto material =
      FindCodec(GetParam())->Encode(btf, {.kl = 25, .kv = 25, .eigen_textures = 3, .rank = 6}, {});
  ASSERT_TRUE(material.ok()) << material.status();
  const auto decoder = *MakeDecoder(material->btfels);
  std::vector<double> c(material->btfels.num_coefficients);
  decoder->Dequantize(material->btfels.btfel(0), c);
  const LinearForm form = decoder->LightHarmonics(1, {0, 0, 1})[0];
  const Eigen::Array3d value = std::sqrt(4.0 * kPi) * form.ValueOf(c);
  const double expected = 2.0 * kPi * (1.0 - 0.5 * std::cos(RadFromDeg(75.0)));
  // What the codecs themselves lose on a constant; "dsh-cls" is bound by its energy.
  const double tolerance = GetParam() == "dsh-cls" ? 0.1 : 0.02;
  EXPECT_NEAR(value.maxCoeff(), expected, tolerance * expected);
  EXPECT_NEAR(value.minCoeff(), expected, tolerance * expected);
}

TEST_P(LightHarmonicsTest, FollowsTheFormatAtTheViewsHorizon) {
  const Material material = Encode(75.0);
  const auto decoder = *MakeDecoder(material.btfels);
  const auto below = decoder->LightHarmonics(4, VectorFromDirection({1.7, 1.0}));
  ASSERT_EQ(below.size(), 4U);
  EXPECT_TRUE(below[3].runs.empty());
  const auto clamped = decoder->LightHarmonics(4, VectorFromDirection({1.5, 1.0}));
  const auto limit = decoder->LightHarmonics(4, VectorFromDirection({RadFromDeg(75.0), 1.0}));
  ASSERT_EQ(clamped[2].weights.size(), limit[2].weights.size());
  for (size_t i = 0; i < limit[2].weights.size(); ++i) {
    EXPECT_NEAR(clamped[2].weights[i], limit[2].weights[i], 1e-6);
  }
}

INSTANTIATE_TEST_SUITE_P(AllCodecs, LightHarmonicsTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);

}  // namespace
}  // namespace tessera
