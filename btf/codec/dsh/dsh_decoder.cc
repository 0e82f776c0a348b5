#include "btf/codec/dsh/dsh_decoder.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "btf/base/status_macros.h"
#include "btf/codec/light_harmonics.h"
#include "btf/codec/table_checks.h"
#include "btf/math/max_theta.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

absl::StatusOr<Eigen::MatrixXd> Basis(const BtfelTable& table, const std::string& name,
                                      const std::string& parameter) {
  const auto found = table.tables.find(name);
  if (found == table.tables.end()) {
    return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "' is missing"));
  }
  const CodecTable& values = found->second;
  const int64_t n = values.shape.size() == 2 ? values.shape[0] : 0;
  if (n < 1 || n > kMaxShFunctions || !IsShFunctionCount(static_cast<int>(n)) || values.shape[1] != n ||
      values.values.size() != static_cast<size_t>(n * n)) {
    return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "': shape [",
                                                   absl::StrJoin(values.shape, ", "),
                                                   "], expected a square of 1, 4, 9, 16, 25, 36 or 49"));
  }
  const auto recorded = table.parameters.find(parameter);
  if (recorded == table.parameters.end() || !recorded->is_number_integer() || recorded->get<int64_t>() != n) {
    return absl::InvalidArgumentError(
        absl::StrCat("codec parameter ", parameter, " is not the ", n, " of table '", name, "'"));
  }
  return Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
             values.values.data(), n, n)
      .cast<double>();
}

}  // namespace

absl::StatusOr<std::unique_ptr<DshDecoder>> DshDecoder::Create(const BtfelTable& table) {
  TESSERA_ASSIGN_OR_RETURN(Eigen::MatrixXd basis_light, Basis(table, "basis_light", "kl"));
  TESSERA_ASSIGN_OR_RETURN(Eigen::MatrixXd basis_view, Basis(table, "basis_view", "kv"));
  TESSERA_RETURN_IF_ERROR(CheckDirections(table.lights, "lights"));
  TESSERA_RETURN_IF_ERROR(CheckDirections(table.views, "views"));
  const int64_t expected = 3 * basis_light.rows() * basis_view.rows();
  if (table.num_coefficients != expected || std::cmp_not_equal(table.offset.size(), expected) ||
      std::cmp_not_equal(table.step.size(), expected)) {
    return absl::InvalidArgumentError(absl::StrCat(table.num_coefficients, " coefficients with ",
                                                   table.offset.size(), " offsets and ", table.step.size(),
                                                   " steps, expected ", expected, " = 3 * kl ",
                                                   basis_light.rows(), " * kv ", basis_view.rows()));
  }
  return std::unique_ptr<DshDecoder>(new DshDecoder(table, std::move(basis_light), std::move(basis_view)));
}

DshDecoder::DshDecoder(const BtfelTable& table, Eigen::MatrixXd basis_light, Eigen::MatrixXd basis_view)
    : Decoder(table),
      basis_light_(std::move(basis_light)),
      basis_view_(std::move(basis_view)),
      is_light_plain_(basis_light_.isIdentity(0.0)),
      is_view_plain_(basis_view_.isIdentity(0.0)),
      light_limit_(LimitOf(table.lights)),
      view_limit_(LimitOf(table.views)) {}

DshDecoder::PolarLimit DshDecoder::LimitOf(const std::vector<Direction>& directions) {
  PolarLimit limit;
  limit.theta_rad = MaxThetaRad(directions);
  limit.cos_theta = std::cos(limit.theta_rad);
  limit.sin_theta = std::sin(limit.theta_rad);
  return limit;
}

bool DshDecoder::Weights(const Eigen::Vector3d& direction, const PolarLimit& limit,
                         const Eigen::MatrixXd& basis, bool is_plain, std::span<double> weights) {
  assert(std::cmp_equal(weights.size(), basis.rows()));
  if (direction.z() <= 0.0) {
    std::ranges::fill(weights, 0.0);
    return false;
  }
  Eigen::Vector3d clamped = direction;
  if (direction.z() < limit.cos_theta) {
    // Not the pole: z is below a cosine, so x and y are not both 0.
    clamped.head<2>() *= limit.sin_theta / direction.head<2>().norm();
    clamped.z() = limit.cos_theta;
  }
  EvaluateSh(clamped, weights);
  if (!is_plain) {
    std::array<double, kMaxShFunctions> plain{};
    std::ranges::copy(weights, plain.begin());
    Eigen::Map<Eigen::VectorXd>(weights.data(), basis.rows()) =
        basis * Eigen::Map<const Eigen::VectorXd>(plain.data(), basis.rows());
  }
  return true;
}

void DshDecoder::LightWeights(const Eigen::Vector3d& light, std::span<double> weights) const {
  if (Weights(light, light_limit_, basis_light_, is_light_plain_, weights) &&
      light.z() < light_limit_.cos_theta) {
    const double scale = light.z() / light_limit_.cos_theta;
    for (double& weight : weights) {
      weight *= scale;
    }
  }
}

void DshDecoder::ViewWeights(const Eigen::Vector3d& view, std::span<double> weights) const {
  Weights(view, view_limit_, basis_view_, is_view_plain_, weights);
}

LinearForm DshDecoder::Form(const Eigen::Vector3d& light, const Eigen::Vector3d& view) const {
  if (light.z() <= 0.0 || view.z() <= 0.0) {
    return {};
  }
  std::array<double, kMaxShFunctions> light_weights{};
  std::array<double, kMaxShFunctions> view_weights{};
  LightWeights(light, std::span(light_weights).first(kl()));
  ViewWeights(view, std::span(view_weights).first(kv()));
  return FormOf(light_weights, view_weights);
}

const Eigen::MatrixXd& DshDecoder::LightIntegrals() const {
  std::call_once(is_integrated_, [this] {
    light_integrals_ = LightHarmonicIntegrals(
        kl(), light_limit_.theta_rad,
        [this](const Eigen::Vector3d& light, std::span<double> values) { LightWeights(light, values); });
  });
  return light_integrals_;
}

std::vector<LinearForm> DshDecoder::LightHarmonics(int n, const Eigen::Vector3d& view) const {
  assert(IsShFunctionCount(n));
  std::vector<LinearForm> forms(n);
  std::array<double, kMaxShFunctions> view_weights{};
  if (view.z() <= 0.0) {
    return forms;
  }
  ViewWeights(view, std::span(view_weights).first(kv()));
  for (int i = 0; i < n; ++i) {
    forms[i] = FormOf(std::span(LightIntegrals().col(i).data(), kl()), view_weights);
  }
  return forms;
}

LinearForm DshDecoder::FormOf(std::span<const double> light_weights,
                              std::span<const double> view_weights) const {
  LinearForm form;
  form.weights.reserve(num_coefficients());
  for (int channel = 0; channel < 3; ++channel) {
    form.runs.push_back({channel, channel * kl() * kv(), kl() * kv()});
    for (int j = 0; j < kv(); ++j) {
      for (int i = 0; i < kl(); ++i) {
        form.weights.push_back(view_weights[j] * light_weights[i]);
      }
    }
  }
  return form;
}

}  // namespace tessera
