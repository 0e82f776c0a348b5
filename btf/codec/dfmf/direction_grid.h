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
  int trend = 16;       // spherical harmonics of the trend: 1, 4, 9, 16 or 25
  double ridge = 0.01;  // of the trend, in units of its Gram matrix over the hemisphere; > 0
  // Directions are compared in the plane, at tan(bend theta) / bend from its centre: bend 1 is where the view
  // ray meets a plane below, which is how relief shifts with the view. In [0.1, kMaxBend].
  double bend = 0.5;
  double range = 1.0;    // of what directions share, in that plane; > 0
  double detail = 0.03;  // variance of what each direction has for itself, over that of the former; >= 0
  double detail_range = 0.15;  // how far it reaches; > 0
  double nugget = 3e-4;        // variance of noise at a measured direction, in the same units; > 0
};

// At the horizon tan is then 6.3.
inline constexpr double kMaxBend = 0.9;

// The point of the plane above where `direction`, a unit vector with z >= 0, is compared.
[[nodiscard]] Eigen::Vector2d BentPoint(const Eigen::Vector3d& direction, double bend);
// Covariance of two directions `distance` apart in that plane: with k(s) = (1 + sqrt(3) s) exp(-sqrt(3) s),
// the Matern function 3/2, k(distance / range) + detail k(distance / detail_range).
[[nodiscard]] double ResampleCovariance(double distance, const ResampleRule& rule);

// [nodes][directions]: node values from measured ones. With B [directions][nodes] the barycentric weights at
// the directions, Y the harmonics at the nodes, K the nodes' ResampleCovariance and G the Gram matrix of the
// harmonics over the hemisphere,
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
