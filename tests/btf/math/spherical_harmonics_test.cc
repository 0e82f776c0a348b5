#include "btf/math/spherical_harmonics.h"

#include <array>
#include <cmath>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/math/conventions.h"
#include "btf/math/hemisphere_gram.h"

namespace tessera {
namespace {

constexpr double kRounding = 1e-13;  // a few hundred operations in double

Eigen::Matrix3Xd RandomDirections(int count, uint64_t seed) {
  Rng rng(seed);
  Eigen::Matrix3Xd directions(3, count);
  for (int i = 0; i < count; ++i) {
    const double z = 2.0 * rng.NextDouble() - 1.0;
    const double phi = 2.0 * kPi * rng.NextDouble();
    const double r = std::sqrt(1.0 - z * z);
    directions.col(i) << r * std::cos(phi), r * std::sin(phi), z;
  }
  return directions;
}

// The whole sphere: the hemisphere's rule and its mirror image.
HemisphereQuadrature SphereQuadrature(int degree) {
  const HemisphereQuadrature half = MakeHemisphereQuadrature(degree);
  HemisphereQuadrature sphere;
  sphere.directions.resize(3, 2 * half.directions.cols());
  sphere.weights.resize(2 * half.weights.size());
  sphere.directions << half.directions, Eigen::Vector3d(1, 1, -1).asDiagonal() * half.directions;
  sphere.weights << half.weights, half.weights;
  return sphere;
}

TEST(SphericalHarmonicsTest, MatchesClosedFormsUpToDegree2) {
  const Eigen::Matrix3Xd directions = RandomDirections(100, 1);
  for (int i = 0; i < directions.cols(); ++i) {
    const double x = directions(0, i);
    const double y = directions(1, i);
    const double z = directions(2, i);
    const double k1 = std::sqrt(3.0 / (4.0 * kPi));
    const double k2 = 0.5 * std::sqrt(15.0 / kPi);
    const std::array<double, 9> expected = {0.5 * std::sqrt(1.0 / kPi),
                                            k1 * y,
                                            k1 * z,
                                            k1 * x,
                                            k2 * x * y,
                                            k2 * y * z,
                                            0.25 * std::sqrt(5.0 / kPi) * (3.0 * z * z - 1.0),
                                            k2 * x * z,
                                            0.5 * k2 * (x * x - y * y)};
    std::array<double, 9> values{};
    EvaluateSh(directions.col(i), values);
    for (int j = 0; j < 9; ++j) {
      EXPECT_NEAR(values[j], expected[j], kRounding) << "function " << j;
    }
  }
}

TEST(SphericalHarmonicsTest, MatchesTheDefinitionByAssociatedLegendreFunctions) {
  const Eigen::Matrix3Xd directions = RandomDirections(50, 2);
  for (int i = 0; i < directions.cols(); ++i) {
    std::array<double, kMaxShFunctions> values{};
    EvaluateSh(directions.col(i), values);
    const Direction d = DirectionFromVector(directions.col(i));
    for (int l = 0; l <= kMaxShDegree; ++l) {
      for (int m = -l; m <= l; ++m) {
        const int a = std::abs(m);
        const double k =
            std::sqrt((2.0 * l + 1.0) / (4.0 * kPi) * std::tgamma(l - a + 1.0) / std::tgamma(l + a + 1.0));
        const double p = std::assoc_legendre(l, a, std::cos(d.theta_rad));  // without (-1)^m
        const double expected = m == 0  ? k * p
                                : m > 0 ? std::sqrt(2.0) * k * p * std::cos(a * d.phi_rad)
                                        : std::sqrt(2.0) * k * p * std::sin(a * d.phi_rad);
        EXPECT_NEAR(values[l * (l + 1) + m], expected, kRounding * 10) << l << " " << m;
      }
    }
  }
}

TEST(SphericalHarmonicsTest, IsOrthonormalOnTheSphere) {
  const HemisphereQuadrature sphere = SphereQuadrature(kMaxShDegree);
  const Eigen::MatrixXd gram = GramMatrix(ShMatrix(kMaxShFunctions, sphere.directions), sphere.weights);
  EXPECT_LT((gram - Eigen::MatrixXd::Identity(kMaxShFunctions, kMaxShFunctions)).cwiseAbs().maxCoeff(),
            kRounding);
}

TEST(SphericalHarmonicsTest, ManyDirectionsEqualOneByOne) {
  const Eigen::Matrix3Xd directions = RandomDirections(37, 3);
  for (const int count : {1, 4, 9, 16, 25, 36, 49}) {
    const Eigen::MatrixXd basis = ShMatrix(count, directions);
    std::vector<double> values(count);
    for (int i = 0; i < directions.cols(); ++i) {
      EvaluateSh(directions.col(i), values);
      for (int j = 0; j < count; ++j) {
        EXPECT_NEAR(basis(i, j), values[j], kRounding);
      }
    }
  }
}

TEST(SphericalHarmonicsTest, QuarterTurnsOfCoefficientsEqualTurnedDirections) {
  Rng rng(4);
  std::array<double, kMaxShFunctions> c{};
  for (double& value : c) {
    value = rng.NextDouble() - 0.5;
  }
  const Eigen::Matrix3Xd directions = RandomDirections(20, 5);
  for (int turns = 0; turns < 4; ++turns) {
    const ShQuarterTurns q = MakeShQuarterTurns(turns);
    for (int i = 0; i < directions.cols(); ++i) {
      std::array<double, kMaxShFunctions> here{};
      std::array<double, kMaxShFunctions> unturned{};
      EvaluateSh(directions.col(i), here);
      EvaluateSh(UnturnedFromTurned(directions.col(i), turns), unturned);
      double expected = 0.0;
      double actual = 0.0;
      for (int j = 0; j < kMaxShFunctions; ++j) {
        expected += c[j] * unturned[j];
        actual += q.sign[j] * c[q.source[j]] * here[j];
      }
      EXPECT_NEAR(actual, expected, kRounding) << "turns " << turns;
    }
  }
}

TEST(SphericalHarmonicsTest, KnowsLegalCounts) {
  EXPECT_TRUE(IsShFunctionCount(1));
  EXPECT_TRUE(IsShFunctionCount(49));
  EXPECT_FALSE(IsShFunctionCount(0));
  EXPECT_FALSE(IsShFunctionCount(24));
  EXPECT_FALSE(IsShFunctionCount(64));
  EXPECT_EQ(ShDegree(25), 4);
}

}  // namespace
}  // namespace tessera
