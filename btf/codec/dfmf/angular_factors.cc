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

Ranks ChooseRanks(const std::vector<ComponentCost>& luma, const std::vector<ComponentCost>& chroma,
                  double energy, uint64_t fixed_bytes, const RankBudget& budget) {
  assert(!luma.empty());
  Ranks ranks{.luma = 1, .squared_error = energy - luma[0].gain, .bytes = fixed_bytes + luma[0].bytes};
  const auto next = [](const std::vector<ComponentCost>& list, int taken) {
    const bool has_more = static_cast<size_t>(taken) < list.size();
    return has_more && list[taken].gain > 0.0 ? list[taken] : ComponentCost{};
  };
  while (ranks.luma + ranks.chroma < budget.max_rank && ranks.squared_error > budget.squared_error) {
    const ComponentCost a = next(luma, ranks.luma);
    const ComponentCost b = next(chroma, ranks.chroma);
    const auto fits = [&](const ComponentCost& c) {
      return c.gain > 0.0 && ranks.bytes + c.bytes <= budget.max_bytes;
    };
    const bool take_luma = fits(a) && (!fits(b) || a.gain * static_cast<double>(b.bytes) >=
                                                       b.gain * static_cast<double>(a.bytes));
    if (!take_luma && !fits(b)) {
      break;
    }
    const ComponentCost& taken = take_luma ? a : b;
    ++(take_luma ? ranks.luma : ranks.chroma);
    ranks.squared_error -= taken.gain;
    ranks.bytes += taken.bytes;
  }
  return ranks;
}

}  // namespace tessera
