// Integrals over the hemisphere of products of two functions built from spherical harmonics, by quadrature
// that is exact for them: Gauss-Legendre in cos(theta), uniform in azimuth.
//
//   HemisphereQuadrature q = MakeHemisphereQuadrature(/*degree=*/4);
//   Eigen::MatrixXd gram = GramMatrix(ShMatrix(25, q.directions), q.weights);
//
// Spherical harmonics are orthonormal on the sphere, not on the hemisphere: the integral of f^2 there is c^T
// G c. [Leung2007] 4.2 calls this matrix A.
#pragma once

#include <Eigen/Core>

#include "btf/math/conventions.h"

namespace tessera {

// Nodes (ascending) and weights of the n-point Gauss-Legendre rule on [0, 1]: exact for polynomials up to
// degree 2 n - 1. n >= 1. Newton's method on the Legendre polynomial, error about 1e-16.
struct GaussLegendreRule {
  Eigen::VectorXd nodes;
  Eigen::VectorXd weights;
};
[[nodiscard]] GaussLegendreRule GaussLegendre(int n);

struct HemisphereQuadrature {
  Eigen::Matrix3Xd directions;  // unit, z > 0
  Eigen::VectorXd weights;      // steradians; they add up to 2 pi
};

// Exact for the product of two functions that are spherical polynomials of degree <= `degree` on either side
// of the polar angle `split_theta_rad` in (0, pi/2]: decoded functions are, being clamped beyond the largest
// measured angle (codec/FORMAT.md). No split at pi/2.
[[nodiscard]] HemisphereQuadrature MakeHemisphereQuadrature(int degree, double split_theta_rad = kPi / 2.0);

// sum over directions d of weights[d] basis(d, i) basis(d, j); `basis` is [directions][n]. Symmetric, [n][n].
[[nodiscard]] Eigen::MatrixXd GramMatrix(const Eigen::MatrixXd& basis, const Eigen::VectorXd& weights);

}  // namespace tessera
