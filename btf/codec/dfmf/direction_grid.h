// The grid on which angular factors are interpolated between measured directions, and how they get there.
//
// A square of n x n nodes, n odd, is wrapped around the directions up to the largest measured polar angle
// theta_max by the concentric map (Shirley and Chiu 1997, "A low distortion map between disk and square"):
//
//     (a, b) in [-1, 1]^2, |b| <= |a|:  theta = |a| theta_max, azimuth = pi/4 b/a       (+ pi where a < 0)
//                          |a| <  |b|:  theta = |b| theta_max, azimuth = pi/2 - pi/4 a/b (+ pi where b < 0)
//
// Ring r holds 8 r nodes at equal polar steps, and a quarter turn of a direction is one of the grid: (a, b)
// -> (b, -a). Cells are split into two triangles along the diagonal that points to the centre; a direction's
// value is the barycentric mean of three nodes.
//
//   DirectionGrid grid(max_theta_rad, 13);
//   Eigen::MatrixXd nodes_from_samples = ResampleMatrix(grid, lights, rule);   // [13 * 13][lights]
//   const auto at = grid.Find(light);   // value = sum over i of at.weights[i] * node_values[at.nodes[i]]
//
// Resampling: a trend in spherical harmonics by ridge regression, plus kriging of what it leaves. The data
// are taken as values *of the interpolated grid*, so that they come back at the measured directions whatever
// n.
#pragma once

#include <array>
#include <vector>

#include <absl/status/status.h>
#include <Eigen/Core>

#include "btf/math/conventions.h"

namespace tessera {

class DirectionGrid {
 public:
  struct Stencil {
    std::array<int, 3> nodes;
    std::array<double, 3> weights;  // >= 0, they add up to 1
  };

  // 0 <= max_theta_rad <= pi/2; nodes_per_side is odd, >= 3. Values are constant beyond max_theta_rad, and
  // the grid covers at least kMinCoveredRad.
  DirectionGrid(double max_theta_rad, int nodes_per_side);

  // The polar angle of the outermost ring.
  [[nodiscard]] double covered_rad() const { return covered_rad_; }
  [[nodiscard]] int nodes_per_side() const { return n_; }
  [[nodiscard]] int num_nodes() const { return n_ * n_; }
  // Unit vector of node a_index * n + b_index.
  [[nodiscard]] Eigen::Vector3d NodeDirection(int node) const;
  // `direction` need not be unit, nor above the horizon.
  [[nodiscard]] Stencil Find(const Eigen::Vector3d& direction) const;

  static constexpr double kMinCoveredRad = 0.01;

 private:
  double covered_rad_;
  int n_;
};

// How node values come from measured ones; recorded in the codec's parameters.
struct ResampleRule {
  int trend = 16;        // spherical harmonics of the trend: 1, 4, 9, 16 or 25
  double ridge = 0.01;   // of the trend, in units of its Gram matrix over the hemisphere; > 0
  double range = 0.5;    // of the Matern 3/2 covariance, as a chord of the unit sphere; > 0
  double nugget = 0.01;  // variance of noise at a measured direction, in units of the covariance at 0; > 0
};

// [nodes][directions]: node values from measured ones. With B [directions][nodes] the barycentric weights at
// the directions, Y the harmonics at the nodes, K the covariance k(d) = (1 + sqrt(3) d / range) exp(-sqrt(3)
// d / range) of nodes at a chord d, and G the Gram matrix of the harmonics over the hemisphere,
//
//   C = (Y^T B^T B Y + ridge m / (2 pi) G)^-1 Y^T B^T                  trend coefficients from m samples
//   result = Y C + K B^T (B K B^T + nugget I)^-1 (I - B Y C)
//
// `directions` is not empty and `rule` legal. Cost: O(m^3 + nodes^2 m).
[[nodiscard]] Eigen::MatrixXd ResampleMatrix(const DirectionGrid& grid,
                                             const std::vector<Direction>& directions,
                                             const ResampleRule& rule);

// Errors: INVALID_ARGUMENT naming the parameter that is out of its range.
[[nodiscard]] absl::Status CheckResampleRule(const ResampleRule& rule);

}  // namespace tessera
