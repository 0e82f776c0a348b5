#include "btf/codec/dfmf/angular_factors.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace tessera {

AngularCodes QuantizeFactors(const Eigen::MatrixXd& factors, DType dtype) {
  assert(dtype == DType::kU8 || dtype == DType::kU16);
  const Eigen::Index rows = factors.rows();
  const Eigen::Index rank = factors.cols();
  const double most = dtype == DType::kU8 ? 255.0 : 65535.0;
  AngularCodes result{.codes = {{rows, rank}, std::vector<float>(rows * rank), dtype},
                      .offset = {{rank}, std::vector<float>(rank)},
                      .step = {{rank}, std::vector<float>(rank)}};
  for (Eigen::Index k = 0; k < rank; ++k) {
    const float offset = static_cast<float>(factors.col(k).minCoeff());
    const float step = static_cast<float>((factors.col(k).maxCoeff() - offset) / most);
    result.offset.values[k] = offset;
    result.step.values[k] = step;
    for (Eigen::Index i = 0; i < rows && step > 0.0F; ++i) {
      result.codes.values[i * rank + k] =
          static_cast<float>(std::clamp(std::round((factors(i, k) - offset) / step), 0.0, most));
    }
  }
  return result;
}

std::vector<AngularCodes> QuantizeParts(const Eigen::MatrixXd& factors, Eigen::Index part_rows, DType dtype) {
  std::vector<AngularCodes> parts;
  for (Eigen::Index begin = 0; begin < factors.rows(); begin += part_rows) {
    parts.push_back(QuantizeFactors(factors.middleRows(begin, part_rows), dtype));
  }
  return parts;
}

Eigen::MatrixXd DequantizeFactors(const AngularCodes& codes) {
  const Eigen::Index rank = codes.codes.shape[1];
  Eigen::MatrixXd factors(codes.codes.shape[0], rank);
  for (Eigen::Index i = 0; i < factors.rows(); ++i) {
    for (Eigen::Index k = 0; k < rank; ++k) {
      factors(i, k) = codes.offset.values[k] + codes.step.values[k] * codes.codes.values[i * rank + k];
    }
  }
  return factors;
}

Eigen::VectorXd FactorErrors(const Eigen::MatrixXd& factors, const Eigen::MatrixXd& stored,
                             const Eigen::MatrixXd& light_smoothing, const Eigen::MatrixXd& view_smoothing) {
  const Eigen::Index num_lights = light_smoothing.rows();
  const Eigen::Index num_views = view_smoothing.rows();
  const Eigen::Index parts = factors.rows() / (num_lights * num_views);
  Eigen::VectorXd errors = Eigen::VectorXd::Zero(factors.cols());
  for (Eigen::Index k = 0; k < factors.cols(); ++k) {
    for (Eigen::Index part = 0; part < parts; ++part) {
      const Eigen::Index begin = part * num_lights * num_views;
      const Eigen::Map<const Eigen::MatrixXd> w(stored.col(k).data() + begin, num_lights, num_views);
      const Eigen::Map<const Eigen::MatrixXd> v(factors.col(k).data() + begin, num_lights, num_views);
      errors[k] += (light_smoothing * w * view_smoothing.transpose() - v).squaredNorm();
    }
  }
  return errors;
}

}  // namespace tessera
