#include "btf/codec/light_harmonics.h"

#include <algorithm>
#include <array>

#include "btf/math/hemisphere_gram.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {

Eigen::MatrixXd LightHarmonicIntegrals(
    int num_functions, double max_theta_rad,
    const std::function<void(const Eigen::Vector3d& light, std::span<double> values)>& functions) {
  const HemisphereQuadrature quadrature = MakeHemisphereQuadrature(kLightQuadratureDegree, max_theta_rad);
  Eigen::MatrixXd integrals = Eigen::MatrixXd::Zero(num_functions, kMaxShFunctions);
  Eigen::VectorXd values(num_functions);
  Eigen::RowVectorXd harmonics(kMaxShFunctions);
  for (Eigen::Index q = 0; q < quadrature.weights.size(); ++q) {
    const Eigen::Vector3d light = quadrature.directions.col(q);
    EvaluateSh(light, std::span(harmonics.data(), kMaxShFunctions));
    harmonics *= quadrature.weights[q];
    values.setZero();
    functions(light, std::span(values.data(), static_cast<size_t>(num_functions)));
    // Hats: almost all are 0.
    for (Eigen::Index j = 0; j < num_functions; ++j) {
      if (values[j] != 0.0) {
        integrals.row(j) += values[j] * harmonics;
      }
    }
  }
  return integrals;
}

}  // namespace tessera
