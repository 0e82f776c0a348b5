#include "btf/light/sh_rotation.h"

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

#include "btf/math/spherical_harmonics.h"
#include "tests/btf/light/random_rotation.h"

namespace tessera {
namespace {

constexpr int kDegree = 10;

// The definition, to any degree, by the sum of powers that a Legendre polynomial is: its m-th derivative at z
// times (x + i y)^m.
Eigen::VectorXd SlowSh(const Eigen::Vector3d& d, int degree) {
  const auto factorial = [](int n) { return std::tgamma(n + 1.0L); };
  const std::complex<long double> across(d.x(), d.y());
  Eigen::VectorXd y((degree + 1) * (degree + 1));
  for (int l = 0; l <= degree; ++l) {
    for (int m = 0; m <= l; ++m) {
      long double derivative = 0.0L;
      for (int k = 0; 2 * k <= l - m; ++k) {
        derivative += (k % 2 == 0 ? 1.0L : -1.0L) * factorial(2 * l - 2 * k) /
                      (factorial(k) * factorial(l - k) * factorial(l - 2 * k - m)) *
                      std::pow(static_cast<long double>(d.z()), l - 2 * k - m);
      }
      const long double norm =
          std::sqrt((2 * l + 1) / (4.0L * std::numbers::pi_v<long double>)*factorial(l - m) /
                    factorial(l + m)) *
          std::pow(2.0L, -l) * (m == 0 ? 1.0L : std::sqrt(2.0L));
      std::complex<long double> power(1.0L, 0.0L);
      for (int i = 0; i < m; ++i) {
        power *= across;
      }
      y[l * (l + 1) - m] = static_cast<double>(norm * derivative * power.imag());
      y[l * (l + 1) + m] = static_cast<double>(norm * derivative * power.real());
    }
  }
  return y;
}

double LargestError(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& d, int degree) {
  return (ShRotation(rotation, degree).Apply(SlowSh(d, degree)) - SlowSh(rotation * d, degree))
      .cwiseAbs()
      .maxCoeff();
}

TEST(ShRotationTest, SlowHarmonicsAreThoseOfTheCodeBase) {
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d d = RandomDirection(rng);
    Eigen::VectorXd y(49);
    EvaluateSh(d, std::span(y.data(), 49));
    EXPECT_LT((y - SlowSh(d, 6)).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(ShRotationTest, TenThousandRandomRotations) {
  // Of values up to 2; the harmonics themselves are right to 1e-14.
  constexpr double kTolerance = 1e-12;
  Rng rng(2);
  double worst = 0.0;
  for (int i = 0; i < 10000; ++i) {
    const Eigen::Matrix3d rotation = RandomRotation(rng);
    const Eigen::Vector3d d = RandomDirection(rng);
    Eigen::VectorXd y(49);
    Eigen::VectorXd turned(49);
    EvaluateSh(d, std::span(y.data(), 49));
    EvaluateSh(rotation * d, std::span(turned.data(), 49));
    worst = std::max(worst, (ShRotation(rotation, 6).Apply(y) - turned).cwiseAbs().maxCoeff());
    if (i % 20 == 0) {
      worst = std::max(worst, LargestError(rotation, d, kDegree));
    }
  }
  RecordProperty("worst", testing::PrintToString(worst));
  EXPECT_LT(worst, kTolerance);
}

TEST(ShRotationTest, OrthogonalComposesAndInverts) {
  constexpr double kTolerance = 1e-12;
  Rng rng(3);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Matrix3d a = RandomRotation(rng);
    const Eigen::Matrix3d b = RandomRotation(rng);
    const Eigen::MatrixXd of_a = ShRotation(a, kDegree).Matrix();
    const Eigen::MatrixXd of_b = ShRotation(b, kDegree).Matrix();
    EXPECT_LT((of_a * of_a.transpose() - Eigen::MatrixXd::Identity(121, 121)).cwiseAbs().maxCoeff(),
              kTolerance);
    EXPECT_LT((of_a * of_b - ShRotation(a * b, kDegree).Matrix()).cwiseAbs().maxCoeff(), kTolerance);
    EXPECT_LT((of_a.transpose() - ShRotation(a.transpose(), kDegree).Matrix()).cwiseAbs().maxCoeff(),
              kTolerance);
  }
}

TEST(ShRotationTest, PolesNeedNoCare) {
  Rng rng(4);
  std::vector<double> angles = {0.0, kPi / 2.0, kPi, 3.0 * kPi / 2.0};
  for (const double nearly : {1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 1e-300}) {
    for (const double around : {0.0, kPi / 2.0, kPi}) {
      angles.push_back(around + nearly);
      angles.push_back(around - nearly);
    }
  }
  const std::vector<Eigen::Vector3d> directions = {{0, 0, 1},  {0, 0, -1},           {1, 0, 0},
                                                   {0, -1, 0}, RandomDirection(rng), RandomDirection(rng)};
  for (int axis = 0; axis < 3; ++axis) {
    for (const double angle : angles) {
      Eigen::Matrix3d rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::Unit(axis)).toRotationMatrix();
      for (const Eigen::Vector3d& d : directions) {
        EXPECT_LT(LargestError(rotation, d, kDegree), 1e-12) << axis << ' ' << angle;
      }
    }
    // Quarter turns without rounding: exact signed permutations give exact zeros and ones in degree 1.
    for (int turns = 0; turns < 4; ++turns) {
      Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
      for (int i = 0; i < turns; ++i) {
        rotation = (Eigen::AngleAxisd(kPi / 2.0, Eigen::Vector3d::Unit(axis)).toRotationMatrix() * rotation)
                       .array()
                       .round()
                       .matrix()
                       .eval();
      }
      for (const Eigen::Vector3d& d : directions) {
        EXPECT_LT(LargestError(rotation, d, kDegree), 1e-12) << axis << ' ' << turns;
      }
    }
  }
  EXPECT_EQ(ShRotation(Eigen::Matrix3d::Identity(), kDegree).Matrix(), Eigen::MatrixXd::Identity(121, 121));
}

TEST(ShRotationTest, QuarterTurnsAreThoseOfTheTexels) {
  Eigen::Matrix3d unturn;  // UnturnedFromTurned once
  unturn << 0, 1, 0, -1, 0, 0, 0, 0, 1;
  const ShQuarterTurns expected = MakeShQuarterTurns(1);
  // f'(w) = f(unturn w), so f' is seen where directions read unturn^-1 w.
  const Eigen::MatrixXd matrix = ShRotation(unturn.transpose(), 6).Matrix();
  for (int i = 0; i < 49; ++i) {
    for (int j = 0; j < 49; ++j) {
      EXPECT_NEAR(matrix(i, j), j == expected.source[i] ? expected.sign[i] : 0.0, 1e-13);
    }
  }
}

TEST(ShRotationTest, DriftAfterAThousandCompositions) {
  // Rounding adds up like a random walk: sqrt(1000) steps of about 121 eps at worst, 1e-12; the bound leaves
  // a decade.
  constexpr double kDrift = 1e-11;
  Rng rng(5);
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::MatrixXd composed = Eigen::MatrixXd::Identity(121, 121);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Matrix3d next = RandomRotation(rng);
    rotation = next * rotation;
    composed = ShRotation(next, kDegree).Apply(composed);
  }
  const double against_product = (composed - ShRotation(rotation, kDegree).Matrix()).cwiseAbs().maxCoeff();
  const double from_orthogonal =
      (composed * composed.transpose() - Eigen::MatrixXd::Identity(121, 121)).cwiseAbs().maxCoeff();
  RecordProperty("against_product", testing::PrintToString(against_product));
  RecordProperty("from_orthogonal", testing::PrintToString(from_orthogonal));
  EXPECT_LT(against_product, kDrift);
  EXPECT_LT(from_orthogonal, kDrift);
}

TEST(ShRotationTest, FewerCoefficientsTakeFewerBlocks) {
  Rng rng(6);
  const Eigen::Matrix3d rotation = RandomRotation(rng);
  const Eigen::MatrixXd c = Eigen::MatrixXd::NullaryExpr(9, 3, [&] { return rng.NextDouble() - 0.5; });
  EXPECT_LT((ShRotation(rotation, 6).Apply(c) - ShRotation(rotation, 2).Matrix() * c).cwiseAbs().maxCoeff(),
            1e-15);
}

}  // namespace
}  // namespace tessera
