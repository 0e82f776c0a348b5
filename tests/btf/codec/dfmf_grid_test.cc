// The grid of "dfmf" and the resampling onto it.
#include <cmath>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/codec/dfmf/direction_grid.h"
#include "btf/data/direction_sets.h"

namespace tessera {
namespace {

double Value(const DirectionGrid& grid, const Eigen::VectorXd& nodes, const Eigen::Vector3d& d) {
  const DirectionGrid::Stencil at = grid.Find(d);
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) {
    sum += at.weights[i] * nodes[at.nodes[i]];
  }
  return sum;
}

TEST(DirectionGridTest, FindsItsNodes) {
  for (const int n : {3, 5, 17}) {
    const DirectionGrid grid(1.3, n);
    for (int node = 0; node < n * n; ++node) {
      const Eigen::Vector3d d = grid.NodeDirection(node);
      EXPECT_NEAR(d.norm(), 1.0, 1e-12);
      const DirectionGrid::Stencil at = grid.Find(d);
      double here = 0.0;
      for (int i = 0; i < 3; ++i) {
        EXPECT_GE(at.weights[i], -1e-12);
        here += at.nodes[i] == node ? at.weights[i] : 0.0;
      }
      EXPECT_NEAR(here, 1.0, 1e-9) << n << ' ' << node;
    }
  }
}

TEST(DirectionGridTest, IsClosedUnderQuarterTurns) {
  const DirectionGrid grid(1.3, 9);
  Rng rng(1);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d d = VectorFromDirection({1.4 * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()});
    Eigen::VectorXd here = Eigen::VectorXd::Zero(81);
    Eigen::VectorXd turned = Eigen::VectorXd::Zero(81);
    const DirectionGrid::Stencil a = grid.Find(d);
    const DirectionGrid::Stencil b = grid.Find(UnturnedFromTurned(d, 1));
    for (int corner = 0; corner < 3; ++corner) {
      // (a, b) -> (b, -a)
      const int row = a.nodes[corner] / 9;
      const int column = a.nodes[corner] % 9;
      here[column * 9 + 8 - row] += a.weights[corner];
      turned[b.nodes[corner]] += b.weights[corner];
    }
    EXPECT_LT((here - turned).cwiseAbs().maxCoeff(), 1e-9);
  }
}

TEST(DirectionGridTest, WeightsAreContinuousAndAddUp) {
  const DirectionGrid grid(1.3, 7);
  Rng rng(2);
  Eigen::VectorXd nodes(49);
  for (double& v : nodes) {
    v = rng.NextDouble();
  }
  for (int i = 0; i < 3000; ++i) {
    const Direction d{1.5 * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()};
    const Eigen::Vector3d v = VectorFromDirection(d);
    const Eigen::Vector3d near =
        v + 1e-7 * Eigen::Vector3d(rng.NextDouble() - 0.5, rng.NextDouble() - 0.5, 0.0);
    EXPECT_NEAR(Value(grid, nodes, v), Value(grid, nodes, near), 1e-5);
    EXPECT_NEAR(Value(grid, Eigen::VectorXd::Ones(49), v), 1.0, 1e-12);
  }
  // Constant beyond the largest angle, and at the pole's other side.
  EXPECT_DOUBLE_EQ(Value(grid, nodes, VectorFromDirection({1.3, 2.0})),
                   Value(grid, nodes, VectorFromDirection({1.5, 2.0})));
}

TEST(ResampleMatrixTest, GivesTheDataBackAndReproducesConstants) {
  const std::vector<Direction> directions = *DirectionSet("ubo81");
  const DirectionGrid grid(RadFromDeg(75.0), 17);
  ResampleRule rule;
  const Eigen::MatrixXd loose = ResampleMatrix(grid, directions, rule);
  rule.nugget = 1e-6;
  const Eigen::MatrixXd exact = ResampleMatrix(grid, directions, rule);
  ASSERT_EQ(exact.rows(), 289);
  ASSERT_EQ(exact.cols(), 81);
  // Something sharp, and a constant.
  Eigen::VectorXd sharp(81);
  for (int i = 0; i < 81; ++i) {
    sharp[i] =
        std::exp(-20.0 * (1.0 - VectorFromDirection(directions[i]).dot(VectorFromDirection({0.5, 1.0}))));
  }
  const Eigen::VectorXd nodes = exact * sharp;
  for (int i = 0; i < 81; ++i) {
    EXPECT_NEAR(Value(grid, nodes, VectorFromDirection(directions[i])), sharp[i], 1e-4) << i;
  }
  const Eigen::VectorXd flat = loose * Eigen::VectorXd::Ones(81);
  // The trend's ridge takes up to this.
  EXPECT_NEAR(flat.minCoeff(), 1.0, 0.02);
  EXPECT_NEAR(flat.maxCoeff(), 1.0, 0.02);
}

TEST(ResampleMatrixTest, SmoothFunctionsComeBackBetweenTheData) {
  const std::vector<Direction> directions = *DirectionSet("ubo81");
  const DirectionGrid grid(RadFromDeg(75.0), 17);
  const Eigen::MatrixXd resample = ResampleMatrix(grid, directions, {});
  const auto smooth = [](const Eigen::Vector3d& d) { return 0.4 + 0.3 * d.z() * d.x() + 0.2 * d.y(); };
  Eigen::VectorXd samples(81);
  for (int i = 0; i < 81; ++i) {
    samples[i] = smooth(VectorFromDirection(directions[i]));
  }
  const Eigen::VectorXd nodes = resample * samples;
  Rng rng(3);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector3d d =
        VectorFromDirection({RadFromDeg(75.0) * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()});
    EXPECT_NEAR(Value(grid, nodes, d), smooth(d), 0.01);
  }
}

TEST(ResampleMatrixTest, RefusesRulesOutOfRange) {
  EXPECT_TRUE(CheckResampleRule({}).ok());
  EXPECT_FALSE(CheckResampleRule({.trend = 36}).ok());
  EXPECT_FALSE(CheckResampleRule({.ridge = 0.0}).ok());
  EXPECT_FALSE(CheckResampleRule({.bend = 0.0}).ok());
  EXPECT_FALSE(CheckResampleRule({.bend = 1.0}).ok());
  EXPECT_FALSE(CheckResampleRule({.range = -1.0}).ok());
  EXPECT_FALSE(CheckResampleRule({.detail = -0.1}).ok());
  EXPECT_FALSE(CheckResampleRule({.detail_range = 0.0}).ok());
  EXPECT_FALSE(CheckResampleRule({.nugget = std::nan("")}).ok());
}

}  // namespace
}  // namespace tessera
