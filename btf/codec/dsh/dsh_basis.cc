#include "btf/codec/dsh/dsh_basis.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include <Eigen/Cholesky>

#include "btf/math/hemisphere_gram.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {

Eigen::MatrixXd OrthonormalDshBasis(int n, DshArgument argument, double max_theta_rad) {
  const int degree = ShDegree(n);
  const double cosine = std::cos(max_theta_rad);
  const double sine = std::sin(max_theta_rad);
  HemisphereQuadrature quadrature = MakeHemisphereQuadrature(degree, max_theta_rad);
  for (Eigen::Index i = 0; i < quadrature.directions.cols(); ++i) {
    auto direction = quadrature.directions.col(i);
    if (direction.z() < cosine) {
      if (argument == DshArgument::kLight) {
        const double scale = direction.z() / cosine;
        quadrature.weights[i] *= scale * scale;
      }
      direction.head<2>() *= sine / direction.head<2>().norm();
      direction.z() = cosine;
    }
  }
  const Eigen::MatrixXd gram = GramMatrix(ShMatrix(n, quadrature.directions), quadrature.weights);
  const double floor = kDshGramFloor * gram.diagonal().maxCoeff();

  Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(n, n);
  for (int m = 0; m <= degree; ++m) {
    const int size = degree - m + 1;  // functions (m, m) .. (degree, m)
    const auto index = [m](int row, int sign) { return (m + row) * (m + row + 1) + sign * m; };
    Eigen::MatrixXd block(size, size);
    for (int row = 0; row < size; ++row) {
      for (int column = 0; column < size; ++column) {
        block(row, column) = gram(index(row, 1), index(column, 1));
      }
    }
    block.diagonal().array() += floor;
    const Eigen::MatrixXd inverse = block.llt().matrixL().solve(Eigen::MatrixXd::Identity(size, size));
    for (const int sign : {-1, 1}) {
      for (int row = 0; row < size; ++row) {
        for (int column = 0; column <= row; ++column) {
          basis(index(row, sign), index(column, sign)) = static_cast<float>(inverse(row, column));
        }
      }
    }
  }
  return basis;
}

Eigen::MatrixXd DshPenalty(const Eigen::MatrixXd& basis) {
  const int n = static_cast<int>(basis.rows());
  const HemisphereQuadrature quadrature = MakeHemisphereQuadrature(ShDegree(n));
  // Laplacians of the functions at the nodes, [nodes][n].
  Eigen::MatrixXd laplacian = ShMatrix(n, quadrature.directions);
  for (int l = 0; l <= ShDegree(n); ++l) {
    laplacian.middleCols(l * l, 2 * l + 1) *= l * (l + 1);
  }
  laplacian = (laplacian * basis.transpose()).eval();
  return Eigen::MatrixXd::Identity(n, n) + kDshRoughness * GramMatrix(laplacian, quadrature.weights);
}

}  // namespace tessera
