// Ridge regression against textbook solves and leave-one-out validation.
#include "btf/math/ridge.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "btf/base/rng.h"

namespace tessera {
namespace {

Eigen::MatrixXd RandomMatrix(Eigen::Index rows, Eigen::Index columns, uint64_t seed) {
  Rng rng(seed);
  Eigen::MatrixXd m(rows, columns);
  for (Eigen::Index i = 0; i < m.size(); ++i) {
    m.data()[i] = rng.NextDouble() - 0.5;
  }
  return m;
}

Eigen::MatrixXd Textbook(const Eigen::MatrixXd& y, double ridge) {
  return (y.transpose() * y + ridge * Eigen::MatrixXd::Identity(y.cols(), y.cols())).inverse() *
         y.transpose();
}

TEST(RidgeRegressionTest, SolvesTheNormalEquations) {
  for (const auto& [samples, unknowns] : {std::pair(20, 9), std::pair(9, 9), std::pair(5, 9)}) {
    const Eigen::MatrixXd y = RandomMatrix(samples, unknowns, 1);
    for (const double ridge : {1e-3, 0.1, 10.0}) {
      EXPECT_LT((RidgeRegression(y).Fit(ridge) - Textbook(y, ridge)).norm(), 1e-10)
          << samples << ' ' << unknowns << ' ' << ridge;
    }
  }
}

TEST(RidgeRegressionTest, WeighsThePenalty) {
  const Eigen::MatrixXd y = RandomMatrix(12, 9, 11);
  const Eigen::MatrixXd root = RandomMatrix(9, 9, 12);
  const Eigen::MatrixXd penalty = root * root.transpose() + Eigen::MatrixXd::Identity(9, 9);
  for (const double ridge : {1e-3, 0.1, 10.0}) {
    const Eigen::MatrixXd expected = (y.transpose() * y + ridge * penalty).inverse() * y.transpose();
    EXPECT_LT((RidgeRegression(y, penalty).Fit(ridge) - expected).norm(), 1e-9 * expected.norm()) << ridge;
  }
}

double ChooseRidge(const RidgeRegression& regression, const Eigen::MatrixXd& signals, double max_ridge) {
  const Eigen::MatrixXf samples = signals.cast<float>();
  return regression.ChooseRidge(EnergiesOf(samples, regression.Project(samples)), max_ridge);
}

// The definition, with the hat matrix written out, over the same ridges.
double SlowChoice(const Eigen::MatrixXd& y, const Eigen::MatrixXd& f, double largest) {
  std::vector<double> ridges;
  std::vector<double> scores;
  for (int step = 0; step <= 56; ++step) {
    ridges.push_back(largest * 1e-6 * std::pow(10.0, step / 8.0));
    const Eigen::MatrixXd hat = y * Textbook(y, ridges.back());
    const double freedom = static_cast<double>(y.rows()) - hat.trace();
    scores.push_back((f - hat * f).squaredNorm() / (freedom * freedom));
  }
  const double least = *std::min_element(scores.begin(), scores.end());
  for (size_t i = 0; i < scores.size(); ++i) {
    if (scores[i] <= least * 1.01) {
      return ridges[i];
    }
  }
  return 0.0;
}

TEST(RidgeRegressionTest, ChoosesTheLeastScore) {
  const Eigen::MatrixXd y = RandomMatrix(30, 12, 2);
  const double largest =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(y.transpose() * y).eigenvalues().maxCoeff();
  const Eigen::MatrixXd truth = RandomMatrix(12, 40, 3);
  double previous = 0.0;
  for (const double noise : {0.0, 0.3, 3.0}) {
    const Eigen::MatrixXd f = y * truth + noise * RandomMatrix(30, 40, 4);
    const double ridge = ChooseRidge(RidgeRegression(y), f, 10.0);
    EXPECT_NEAR(ridge / SlowChoice(y, f, largest), 1.0, 1e-6) << noise;
    EXPECT_GT(ridge, previous) << "more noise, more ridge";
    previous = ridge;
    EXPECT_LE(ChooseRidge(RidgeRegression(y), f, 0.01), 0.0101 * largest);
  }
}

TEST(RidgeRegressionTest, NoiseIsKeptOut) {
  // 20 samples of 25 unknowns, as with few measured directions: interpolation would keep all the noise.
  const Eigen::MatrixXd y = RandomMatrix(20, 25, 5);
  const Eigen::MatrixXd clean = y * RandomMatrix(25, 100, 6);
  const Eigen::MatrixXd noisy = clean + 2.0 * RandomMatrix(20, 100, 7);
  const RidgeRegression regression(y);
  const double chosen = (y * regression.Fit(ChooseRidge(regression, noisy, 10.0)) * noisy - clean).norm();
  EXPECT_LT(chosen, 0.95 * (noisy - clean).norm());
}

TEST(RidgeRegressionTest, TiesTakeTheSmallestRidge) {
  // One sample: every ridge scores the same. Signals of 0: all scores are 0.
  const Eigen::MatrixXd one = Eigen::MatrixXd::Constant(1, 1, 2.0);
  EXPECT_NEAR(ChooseRidge(RidgeRegression(one), Eigen::MatrixXd::Constant(1, 3, 0.7), 10.0), 4e-6, 1e-12);
  const Eigen::MatrixXd y = RandomMatrix(10, 4, 8);
  const double black = ChooseRidge(RidgeRegression(y), Eigen::MatrixXd::Zero(10, 3), 10.0);
  EXPECT_GT(black, 0.0);
  EXPECT_EQ(ChooseRidge(RidgeRegression(y), Eigen::MatrixXd(10, 0), 10.0), black);
  const RidgeRegression nothing(Eigen::MatrixXd::Zero(3, 2));
  EXPECT_EQ(ChooseRidge(nothing, Eigen::MatrixXd::Ones(3, 1), 10.0), 0.0);
  EXPECT_EQ(nothing.Fit(0.0).cwiseAbs().maxCoeff(), 0.0);
}

TEST(LeastSquaresFitTest, IsThePseudoInverse) {
  const Eigen::MatrixXd tall = RandomMatrix(12, 5, 9);
  EXPECT_LT((LeastSquaresFit(tall, 1e-9) - Textbook(tall, 0.0)).norm(), 1e-10);
  const Eigen::MatrixXd wide = RandomMatrix(5, 12, 10);
  EXPECT_LT((wide * LeastSquaresFit(wide, 1e-9) - Eigen::MatrixXd::Identity(5, 5)).norm(), 1e-10);
  // Two equal columns: the smallest coefficients share what they explain.
  Eigen::MatrixXd twice(4, 2);
  twice << 1, 1, 2, 2, 3, 3, 4, 4;
  const Eigen::VectorXd c = LeastSquaresFit(twice, 1e-9) * Eigen::Vector4d(2, 4, 6, 8);
  EXPECT_LT((c - Eigen::Vector2d(1, 1)).norm(), 1e-12);
}

}  // namespace
}  // namespace tessera
