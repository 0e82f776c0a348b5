#include "btf/codec/dfmf/direction_grid.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <tuple>

#include <absl/strings/str_cat.h>
#include <Eigen/Cholesky>

#include "btf/math/hemisphere_gram.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

// [directions][nodes].
Eigen::MatrixXd StencilMatrix(const DirectionGrid& grid, const std::vector<Direction>& directions) {
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(directions.size()), grid.num_nodes());
  for (size_t i = 0; i < directions.size(); ++i) {
    const DirectionGrid::Stencil stencil = grid.Find(VectorFromDirection(directions[i]));
    for (int corner = 0; corner < 3; ++corner) {
      b(static_cast<Eigen::Index>(i), stencil.nodes[corner]) += stencil.weights[corner];
    }
  }
  return b;
}

double Matern(double distance) {
  const double d = std::sqrt(3.0) * distance;
  return (1.0 + d) * std::exp(-d);
}

}  // namespace

DirectionGrid::DirectionGrid(double max_theta_rad, int nodes_per_side)
    : covered_rad_(std::max(max_theta_rad, kMinCoveredRad)), n_(nodes_per_side) {
  assert(nodes_per_side >= 3 && nodes_per_side % 2 == 1);
}

Eigen::Vector3d DirectionGrid::NodeDirection(int node) const {
  const int half = n_ / 2;
  const double a = static_cast<double>(node / n_ - half) / half;
  const double b = static_cast<double>(node % n_ - half) / half;
  if (a == 0.0 && b == 0.0) {
    return Eigen::Vector3d::UnitZ();
  }
  const bool is_a = std::abs(b) <= std::abs(a);
  const double radius = is_a ? a : b;  // signed
  const double phi = is_a ? kPi / 4.0 * (b / a) : kPi / 2.0 - kPi / 4.0 * (a / b);
  const double sin_theta = std::sin(radius * covered_rad_);
  return {sin_theta * std::cos(phi), sin_theta * std::sin(phi), std::cos(radius * covered_rad_)};
}

DirectionGrid::Stencil DirectionGrid::Find(const Eigen::Vector3d& direction) const {
  const double x = direction.x();
  const double y = direction.y();
  const double theta = std::atan2(std::hypot(x, y), direction.z());
  const double radius = std::min(theta / covered_rad_, 1.0);
  double a = 0.0;
  double b = 0.0;
  if (std::abs(y) <= std::abs(x)) {
    a = std::copysign(radius, x);
    b = x == 0.0 ? 0.0 : a * std::atan(y / x) * (4.0 / kPi);
  } else {
    b = std::copysign(radius, y);
    a = b * std::atan(x / y) * (4.0 / kPi);
  }
  const int half = n_ / 2;
  const double row = (a + 1.0) * half;
  const double column = (b + 1.0) * half;
  const int i = std::clamp(static_cast<int>(row), 0, n_ - 2);
  const int j = std::clamp(static_cast<int>(column), 0, n_ - 2);
  const double f = row - i;
  const double g = column - j;
  const int first = i * n_ + j;
  // Where both halves have one sign the diagonal from (i, j) points to the centre, else the other one does.
  if ((i < half) == (j < half)) {
    return f >= g ? Stencil{{first, first + n_, first + n_ + 1}, {1.0 - f, f - g, g}}
                  : Stencil{{first, first + 1, first + n_ + 1}, {1.0 - g, g - f, f}};
  }
  return f + g <= 1.0 ? Stencil{{first, first + n_, first + 1}, {1.0 - f - g, f, g}}
                      : Stencil{{first + n_ + 1, first + n_, first + 1}, {f + g - 1.0, 1.0 - g, 1.0 - f}};
}

absl::Status CheckResampleRule(const ResampleRule& rule) {
  constexpr int kMaxTrend = 25;
  if (!IsShFunctionCount(rule.trend) || rule.trend > kMaxTrend) {
    return absl::InvalidArgumentError(
        absl::StrCat("trend = ", rule.trend, ": legal values are 1, 4, 9, 16 and 25"));
  }
  // Below the least ridge or nugget the systems cannot be solved to single precision.
  constexpr double kLeast = 1e-6;
  constexpr double kMost = 1e6;
  constexpr double kLeastBend = 0.1;
  for (const auto& [name, value, least, most] :
       {std::tuple("ridge", rule.ridge, kLeast, kMost), std::tuple("bend", rule.bend, kLeastBend, kMaxBend),
        std::tuple("range", rule.range, kLeast, kMost), std::tuple("detail", rule.detail, 0.0, kMost),
        std::tuple("detail_range", rule.detail_range, kLeast, kMost),
        std::tuple("nugget", rule.nugget, kLeast, kMost)}) {
    if (!(value >= least && value <= most)) {
      return absl::InvalidArgumentError(absl::StrCat(name, " = ", value, ", expected ", least, " to ", most));
    }
  }
  return absl::OkStatus();
}

Eigen::Vector2d BentPoint(const Eigen::Vector3d& direction, double bend) {
  const double sine = std::hypot(direction.x(), direction.y());
  const double radius = std::tan(bend * std::atan2(sine, std::max(direction.z(), 0.0))) / bend;
  return sine > 0.0 ? Eigen::Vector2d(direction.head<2>() * (radius / sine)) : Eigen::Vector2d::Zero();
}

double ResampleCovariance(double distance, const ResampleRule& rule) {
  return Matern(distance / rule.range) + rule.detail * Matern(distance / rule.detail_range);
}

Eigen::MatrixXd ResampleMatrix(const DirectionGrid& grid, const std::vector<Direction>& directions,
                               const ResampleRule& rule) {
  assert(!directions.empty() && CheckResampleRule(rule).ok());
  Eigen::Matrix3Xd nodes(3, grid.num_nodes());
  for (int i = 0; i < grid.num_nodes(); ++i) {
    nodes.col(i) = grid.NodeDirection(i);
  }
  const Eigen::Index m = static_cast<Eigen::Index>(directions.size());
  const Eigen::MatrixXd b = StencilMatrix(grid, directions);
  const Eigen::MatrixXd y = ShMatrix(rule.trend, nodes);
  const HemisphereQuadrature quadrature = MakeHemisphereQuadrature(ShDegree(rule.trend));
  const Eigen::MatrixXd gram = GramMatrix(ShMatrix(rule.trend, quadrature.directions), quadrature.weights);
  const Eigen::MatrixXd by = b * y;
  const double ridge = rule.ridge * static_cast<double>(m) / (2.0 * kPi);
  const Eigen::MatrixXd trend = y * (by.transpose() * by + ridge * gram).llt().solve(by.transpose());

  Eigen::Matrix2Xd points(2, grid.num_nodes());
  for (int i = 0; i < grid.num_nodes(); ++i) {
    points.col(i) = BentPoint(nodes.col(i), rule.bend);
  }
  Eigen::MatrixXd covariance(grid.num_nodes(), grid.num_nodes());
  for (int i = 0; i < grid.num_nodes(); ++i) {
    for (int j = 0; j <= i; ++j) {
      covariance(i, j) = covariance(j, i) = ResampleCovariance((points.col(i) - points.col(j)).norm(), rule);
    }
  }
  const Eigen::MatrixXd kb = covariance * b.transpose();
  Eigen::MatrixXd system = b * kb;
  system.diagonal().array() += rule.nugget;
  const Eigen::MatrixXd left = Eigen::MatrixXd::Identity(m, m) - b * trend;
  return trend + kb * system.llt().solve(left);
}

}  // namespace tessera
