#include "btf/math/hemisphere_gram.h"

#include <cmath>

namespace tessera {

GaussLegendreRule GaussLegendre(int n) {
  GaussLegendreRule rule{Eigen::VectorXd(n), Eigen::VectorXd(n)};
  for (int i = 0; i < n; ++i) {
    // Root i of P_n on [-1, 1], descending, from Tricomi's estimate.
    double x = std::cos(kPi * (i + 0.75) / (n + 0.5));
    double derivative = 0.0;
    constexpr int kNewtonSteps = 8;  // quadratic from an error of 1e-2: four would do
    for (int step = 0; step < kNewtonSteps; ++step) {
      double p = 1.0;
      double p_below = 0.0;
      for (int l = 1; l <= n; ++l) {
        const double next = ((2.0 * l - 1.0) * x * p - (l - 1.0) * p_below) / l;
        p_below = p;
        p = next;
      }
      derivative = n * (x * p - p_below) / (x * x - 1.0);
      x -= p / derivative;
    }
    rule.nodes[n - 1 - i] = 0.5 * (1.0 + x);
    rule.weights[n - 1 - i] = 1.0 / ((1.0 - x * x) * derivative * derivative);
  }
  return rule;
}

HemisphereQuadrature MakeHemisphereQuadrature(int degree, double split_theta_rad) {
  // The azimuthal sum kills every product of unequal |m|; the rest is a polynomial in z of degree 2 degree,
  // or, where functions are scaled by cos(theta), z^2.
  const int num_azimuths = 4 * (degree + 1);  // a multiple of 4, so that quarter turns map nodes to nodes
  const GaussLegendreRule rule = GaussLegendre(degree + 2);
  const double split = std::max(0.0, std::cos(split_theta_rad));
  const bool is_split = split > 1e-12;  // cos(pi / 2) rounds to 6e-17
  const int num_polar = static_cast<int>(rule.nodes.size());
  const int num_bands = is_split ? 2 : 1;
  HemisphereQuadrature quadrature;
  quadrature.directions.resize(3, num_bands * num_polar * num_azimuths);
  quadrature.weights.resize(quadrature.directions.cols());
  Eigen::Index index = 0;
  for (int band = 0; band < num_bands; ++band) {
    const double z_begin = !is_split ? 0.0 : band == 0 ? split : 0.0;
    const double z_end = !is_split || band == 0 ? 1.0 : split;
    for (int i = 0; i < num_polar; ++i) {
      const double z = z_begin + (z_end - z_begin) * rule.nodes[i];
      const double sin_theta = std::sqrt(std::max(0.0, 1.0 - z * z));
      for (int j = 0; j < num_azimuths; ++j, ++index) {
        const double phi = 2.0 * kPi * (j + 0.5) / num_azimuths;
        quadrature.directions.col(index) =
            Eigen::Vector3d(sin_theta * std::cos(phi), sin_theta * std::sin(phi), z);
        quadrature.weights[index] = (z_end - z_begin) * rule.weights[i] * 2.0 * kPi / num_azimuths;
      }
    }
  }
  return quadrature;
}

Eigen::MatrixXd GramMatrix(const Eigen::MatrixXd& basis, const Eigen::VectorXd& weights) {
  const Eigen::MatrixXd gram = basis.transpose() * weights.asDiagonal() * basis;
  return 0.5 * (gram + gram.transpose());
}

}  // namespace tessera
