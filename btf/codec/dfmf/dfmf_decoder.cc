#include "btf/codec/dfmf/dfmf_decoder.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/light_harmonics.h"
#include "btf/codec/table_checks.h"
#include "btf/math/max_theta.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

using FactorMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

absl::StatusOr<double> FindNumber(const nlohmann::json& parameters, const std::string& name) {
  const auto found = parameters.find(name);
  if (found == parameters.end() || !found->is_number()) {
    return absl::InvalidArgumentError(absl::StrCat("codec parameter ", name, " is missing or not a number"));
  }
  return found->get<double>();
}

absl::StatusOr<int> FindInteger(const nlohmann::json& parameters, const std::string& name, int least,
                                int most) {
  const auto found = parameters.find(name);
  if (found == parameters.end() || !found->is_number_integer() || found->get<int64_t>() < least ||
      found->get<int64_t>() > most) {
    return absl::InvalidArgumentError(
        absl::StrCat("codec parameter ", name, ": expected an integer from ", least, " to ", most));
  }
  return found->get<int>();
}

// Extends a direction beyond the measured angles: its scale, 0 at and below the horizon.
double LightScale(double z, double max_theta_rad) {
  const double limit = std::max(0.0, std::cos(max_theta_rad));
  return z < limit ? z / limit : 1.0;
}

}  // namespace

absl::StatusOr<DfmfDecoder::Side> DfmfDecoder::MakeSide(const std::vector<Direction>& directions,
                                                        const std::string& name,
                                                        const nlohmann::json& parameters) {
  TESSERA_RETURN_IF_ERROR(CheckDirections(directions, name + "s", kMaxDfmfDirections));
  const double max_theta_rad = MaxThetaRad(directions);
  TESSERA_ASSIGN_OR_RETURN(const int nodes,
                           FindInteger(parameters, name + "_nodes", 3, kMaxGridNodesPerSide));
  if (nodes % 2 == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("codec parameter ", name, "_nodes = ", nodes, ", expected an odd number"));
  }
  ResampleRule rule;
  TESSERA_ASSIGN_OR_RETURN(rule.trend, FindInteger(parameters, name + "_trend", 1, 25));
  TESSERA_ASSIGN_OR_RETURN(rule.bend, FindNumber(parameters, name + "_bend"));
  TESSERA_ASSIGN_OR_RETURN(rule.range, FindNumber(parameters, name + "_range"));
  TESSERA_ASSIGN_OR_RETURN(rule.detail, FindNumber(parameters, name + "_detail"));
  TESSERA_ASSIGN_OR_RETURN(rule.detail_range, FindNumber(parameters, name + "_detail_range"));
  TESSERA_ASSIGN_OR_RETURN(rule.ridge, FindNumber(parameters, "ridge"));
  TESSERA_ASSIGN_OR_RETURN(rule.nugget, FindNumber(parameters, "nugget"));
  TESSERA_RETURN_IF_ERROR(CheckResampleRule(rule));
  return Side{directions, max_theta_rad, DirectionGrid(max_theta_rad, nodes), rule};
}

void DfmfDecoder::TakeFactors(std::span<const float> codes, std::span<const float> offset,
                              std::span<const float> step, int first) {
  const size_t rank = offset.size();
  for (size_t pair = 0; pair * rank < codes.size(); ++pair) {
    float* const to = samples_.data() + pair * num_factors() + first;
    for (size_t i = 0; i < rank; ++i) {
      to[i] = offset[i] + step[i] * codes[pair * rank + i];
    }
  }
}

absl::StatusOr<std::unique_ptr<DfmfDecoder>> DfmfDecoder::Create(const BtfelTable& table) {
  const nlohmann::json& parameters = table.parameters;
  TESSERA_ASSIGN_OR_RETURN(Side light, MakeSide(table.lights, "light", parameters));
  TESSERA_ASSIGN_OR_RETURN(Side view, MakeSide(table.views, "view", parameters));

  const int64_t num_lights = static_cast<int64_t>(table.lights.size());
  const int64_t num_views = static_cast<int64_t>(table.views.size());
  TESSERA_ASSIGN_OR_RETURN(const CodecTable* const colour, FindTable(table, kDfmfColour, {3, 3}));
  TESSERA_ASSIGN_OR_RETURN(const CodecTable* const luma,
                           FindTable(table, kDfmfLuma, {num_views, num_lights, -1}));
  const int64_t r = luma->shape[2];
  const int64_t q = table.num_coefficients - r;
  if (q < 0 || std::cmp_not_equal(table.offset.size(), r + q) ||
      std::cmp_not_equal(table.step.size(), r + q)) {
    return absl::InvalidArgumentError(
        absl::StrCat(table.num_coefficients, " coefficients with ", table.offset.size(), " offsets and ",
                     table.step.size(), " steps, expected at least the ", r, " of table '", kDfmfLuma, "'"));
  }
  TESSERA_ASSIGN_OR_RETURN(const CodecTable* const luma_offset, FindTable(table, kDfmfLumaOffset, {r}));
  TESSERA_ASSIGN_OR_RETURN(const CodecTable* const luma_step, FindTable(table, kDfmfLumaStep, {r}));
  const CodecTable none;
  const CodecTable* chroma = &none;
  const CodecTable* chroma_offset = &none;
  const CodecTable* chroma_step = &none;
  if (q > 0) {
    TESSERA_ASSIGN_OR_RETURN(chroma, FindTable(table, kDfmfChroma, {2, num_views, num_lights, q}));
    TESSERA_ASSIGN_OR_RETURN(chroma_offset, FindTable(table, kDfmfChromaOffset, {2, q}));
    TESSERA_ASSIGN_OR_RETURN(chroma_step, FindTable(table, kDfmfChromaStep, {2, q}));
  }
  const int64_t num_pairs = static_cast<int64_t>(light.grid.num_nodes()) * view.grid.num_nodes();
  if (num_pairs * (r + 2 * q) > kMaxResampledFactors) {
    return absl::InvalidArgumentError(absl::StrCat(r + 2 * q, " factors on ", num_pairs,
                                                   " pairs of nodes, at most ", kMaxResampledFactors,
                                                   " values in all"));
  }

  std::unique_ptr<DfmfDecoder> decoder(new DfmfDecoder(table, std::move(light), std::move(view)));
  decoder->luma_rank_ = static_cast<int>(r);
  decoder->chroma_rank_ = static_cast<int>(q);
  for (int channel = 0; channel < 3; ++channel) {
    for (int j = 0; j < 3; ++j) {
      decoder->colour_(channel, j) = colour->values[3 * channel + j];
    }
  }
  decoder->samples_.resize(static_cast<size_t>(num_views * num_lights) * decoder->num_factors());
  decoder->TakeFactors(luma->values, luma_offset->values, luma_step->values, 0);
  for (int j = 0; j < 2 && q > 0; ++j) {
    const auto part = [j](const CodecTable& of) {
      return std::span(of.values).subspan(j * (of.values.size() / 2), of.values.size() / 2);
    };
    decoder->TakeFactors(part(*chroma), part(*chroma_offset), part(*chroma_step),
                         static_cast<int>(r + j * q));
  }
  return decoder;
}

std::span<const float> DfmfDecoder::grid() const {
  std::call_once(is_resampled_, [this] {
    const Eigen::MatrixXf from_lights =
        ResampleMatrix(light_.grid, light_.directions, light_.rule).cast<float>();
    const Eigen::MatrixXf from_views = ResampleMatrix(view_.grid, view_.directions, view_.rule).cast<float>();
    const Eigen::Index light_nodes = from_lights.rows();
    const Eigen::Index num_views = from_views.cols();
    const Eigen::Index num_lights = from_lights.cols();
    const Eigen::Index k = num_factors();
    // Over the lights of every view, then over the views of every light node.
    FactorMatrix by_node(light_nodes * num_views, k);  // [light node][view]
    FactorMatrix one_view(light_nodes, k);
    for (Eigen::Index v = 0; v < num_views; ++v) {
      one_view.noalias() =
          from_lights * Eigen::Map<const FactorMatrix>(samples_.data() + v * num_lights * k, num_lights, k);
      for (Eigen::Index node = 0; node < light_nodes; ++node) {
        by_node.row(node * num_views + v) = one_view.row(node);
      }
    }
    const Eigen::Index view_nodes = from_views.rows();
    grid_.resize(static_cast<size_t>(light_nodes * view_nodes * k));
    for (Eigen::Index node = 0; node < light_nodes; ++node) {
      Eigen::Map<FactorMatrix>(grid_.data() + node * view_nodes * k, view_nodes, k).noalias() =
          from_views * by_node.middleRows(node * num_views, num_views);
    }
  });
  return grid_;
}

bool DfmfDecoder::Factors(const Eigen::Vector3d& light, const Eigen::Vector3d& view,
                          std::span<double> factors) const {
  assert(std::cmp_equal(factors.size(), num_factors()));
  std::ranges::fill(factors, 0.0);
  if (light.z() <= 0.0 || view.z() <= 0.0) {
    return false;
  }
  const double scale = LightScale(light.z(), light_.max_theta_rad);
  const DirectionGrid::Stencil l = light_.grid.Find(light);
  const DirectionGrid::Stencil v = view_.grid.Find(view);
  const std::span<const float> table = grid();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double weight = scale * l.weights[i] * v.weights[j];
      const float* const from =
          table.data() +
          (static_cast<size_t>(l.nodes[i]) * view_.grid.num_nodes() + v.nodes[j]) * factors.size();
      for (size_t k = 0; k < factors.size(); ++k) {
        factors[k] += weight * from[k];
      }
    }
  }
  return true;
}

LinearForm DfmfDecoder::Form(const Eigen::Vector3d& light, const Eigen::Vector3d& view) const {
  std::vector<double> factors(num_factors());
  return Factors(light, view, factors) ? FormOf(factors) : LinearForm{};
}

const Eigen::MatrixXd& DfmfDecoder::LightIntegrals() const {
  std::call_once(is_integrated_, [this] {
    light_integrals_ = LightHarmonicIntegrals(light_.grid.num_nodes(), light_.max_theta_rad,
                                              [this](const Eigen::Vector3d& light, std::span<double> values) {
                                                const double scale =
                                                    LightScale(light.z(), light_.max_theta_rad);
                                                const DirectionGrid::Stencil at = light_.grid.Find(light);
                                                for (int corner = 0; corner < 3; ++corner) {
                                                  values[at.nodes[corner]] += scale * at.weights[corner];
                                                }
                                              });
  });
  return light_integrals_;
}

Eigen::MatrixXd DfmfDecoder::FactorsUnderHarmonics(const DirectionGrid::Stencil& view, int n) const {
  const Eigen::Index k = num_factors();
  Eigen::MatrixXd factors = Eigen::MatrixXd::Zero(k, n);
  for (int node = 0; node < light_.grid.num_nodes(); ++node) {
    Eigen::VectorXd at_view = Eigen::VectorXd::Zero(k);
    for (int corner = 0; corner < 3; ++corner) {
      const size_t pair = static_cast<size_t>(node) * view_.grid.num_nodes() + view.nodes[corner];
      at_view += view.weights[corner] *
                 Eigen::Map<const Eigen::VectorXf>(grid().data() + pair * k, k).cast<double>();
    }
    factors.noalias() += at_view * LightIntegrals().row(node).head(n);
  }
  return factors;
}

std::vector<LinearForm> DfmfDecoder::LightHarmonics(int n, const Eigen::Vector3d& view) const {
  assert(IsShFunctionCount(n));
  std::vector<LinearForm> forms(n);
  if (view.z() <= 0.0) {
    return forms;
  }
  const Eigen::MatrixXd factors = FactorsUnderHarmonics(view_.grid.Find(view), n);
  for (int i = 0; i < n; ++i) {
    forms[i] = FormOf(std::span(factors.col(i).data(), static_cast<size_t>(factors.rows())));
  }
  return forms;
}

LinearForm DfmfDecoder::FormOf(std::span<const double> factors) const {
  LinearForm form;
  const size_t r = luma_rank_;
  const size_t q = chroma_rank_;
  form.weights.reserve(3 * (r + q));
  for (int channel = 0; channel < 3; ++channel) {
    form.runs.push_back({channel, 0, num_coefficients()});
    for (size_t i = 0; i < r; ++i) {
      form.weights.push_back(colour_(channel, 0) * factors[i]);
    }
    for (size_t i = 0; i < q; ++i) {
      form.weights.push_back(colour_(channel, 1) * factors[r + i] + colour_(channel, 2) * factors[r + q + i]);
    }
  }
  return form;
}

}  // namespace tessera
