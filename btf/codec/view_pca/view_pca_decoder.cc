#include "btf/codec/view_pca/view_pca_decoder.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/light_harmonics.h"
#include "btf/codec/table_checks.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

absl::StatusOr<HemisphereInterpolator> Interpolator(const BtfelTable& table, const std::string& name,
                                                    const std::vector<Direction>& directions) {
  TESSERA_ASSIGN_OR_RETURN(const CodecTable* values, FindTable(table, name, {-1, 3}));
  // A Delaunay triangulation has fewer.
  const size_t limit = 2 * directions.size();
  if (values->values.size() / 3 > limit) {
    return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "': ", values->values.size() / 3,
                                                   " triangles of ", directions.size(),
                                                   " directions, at most ", limit));
  }
  std::vector<DirectionTriangle> triangles(values->values.size() / 3);
  for (size_t i = 0; i < values->values.size(); ++i) {
    const float index = values->values[i];
    if (!(index >= 0.0F && index < static_cast<float>(directions.size())) || index != std::floor(index)) {
      return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "': corner ", index,
                                                     " of triangle ", i / 3,
                                                     ", expected a whole number below ", directions.size()));
    }
    triangles[i / 3][i % 3] = static_cast<int>(index);
  }
  return HemisphereInterpolator(directions, triangles);
}

}  // namespace

absl::StatusOr<std::unique_ptr<ViewPcaDecoder>> ViewPcaDecoder::Create(const BtfelTable& table) {
  TESSERA_RETURN_IF_ERROR(CheckDirections(table.lights, "lights", kMaxViewPcaDirections));
  TESSERA_RETURN_IF_ERROR(CheckDirections(table.views, "views", kMaxViewPcaDirections));
  const auto recorded = table.parameters.find("eigen_textures");
  if (recorded == table.parameters.end() || !recorded->is_number_integer() || recorded->get<int64_t>() < 0 ||
      recorded->get<int64_t>() > kMaxEigenTextures) {
    return absl::InvalidArgumentError(
        absl::StrCat("codec parameter eigen_textures is not a whole number from 0 to ", kMaxEigenTextures));
  }
  const int c = recorded->get<int>();
  const int64_t num_views = static_cast<int64_t>(table.views.size());
  const int64_t num_lights = static_cast<int64_t>(table.lights.size());
  const int64_t expected = num_views * 3 * (c + 1);
  if (table.num_coefficients != expected || std::cmp_not_equal(table.offset.size(), expected) ||
      std::cmp_not_equal(table.step.size(), expected)) {
    return absl::InvalidArgumentError(absl::StrCat(table.num_coefficients, " coefficients with ",
                                                   table.offset.size(), " offsets and ", table.step.size(),
                                                   " steps, expected ", expected, " = 3 * (eigen_textures ",
                                                   c, " + 1) * ", num_views, " views"));
  }
  TESSERA_ASSIGN_OR_RETURN(const CodecTable* codes,
                           FindTable(table, "light_weights", {num_views, num_lights, c}));
  std::vector<float> weights;
  weights.reserve(codes->values.size());
  for (const float code : codes->values) {
    if (!(code >= 0.0F && code <= 2.0F * kZeroWeight)) {
      return absl::InvalidArgumentError(
          absl::StrCat("codec table 'light_weights': ", code, ", expected 0 to ", 2 * kZeroWeight));
    }
    weights.push_back((code - kZeroWeight) / kZeroWeight);
  }
  TESSERA_ASSIGN_OR_RETURN(HemisphereInterpolator lights,
                           Interpolator(table, "light_triangles", table.lights));
  TESSERA_ASSIGN_OR_RETURN(HemisphereInterpolator views, Interpolator(table, "view_triangles", table.views));
  return std::unique_ptr<ViewPcaDecoder>(
      new ViewPcaDecoder(table, c, std::move(lights), std::move(views), std::move(weights)));
}

ViewPcaDecoder::ViewPcaDecoder(const BtfelTable& table, int num_eigen_textures, HemisphereInterpolator lights,
                               HemisphereInterpolator views, std::vector<float> light_weights)
    : Decoder(table),
      num_eigen_textures_(num_eigen_textures),
      num_views_(static_cast<int>(table.views.size())),
      num_lights_(static_cast<int>(table.lights.size())),
      lights_(std::move(lights)),
      views_(std::move(views)),
      light_weights_(std::move(light_weights)) {}

LinearForm ViewPcaDecoder::Form(const Eigen::Vector3d& light, const Eigen::Vector3d& view) const {
  if (light.z() <= 0.0 || view.z() <= 0.0) {
    return {};
  }
  BarycentricWeights at = lights_.Locate(light);
  for (double& weight : at.weight) {
    weight *= LightScale(light);
  }
  return FormOf(at.index, at.weight, view);
}

double ViewPcaDecoder::LightScale(const Eigen::Vector3d& light) const {
  return light.z() < lights_.cos_limit() ? light.z() / lights_.cos_limit() : 1.0;
}

const Eigen::MatrixXd& ViewPcaDecoder::LightIntegrals() const {
  std::call_once(is_integrated_, [this] {
    light_integrals_ = LightHarmonicIntegrals(num_lights_, std::acos(lights_.cos_limit()),
                                              [this](const Eigen::Vector3d& light, std::span<double> values) {
                                                const BarycentricWeights at = lights_.Locate(light);
                                                for (int r = 0; r < 3; ++r) {
                                                  values[at.index[r]] += LightScale(light) * at.weight[r];
                                                }
                                              });
  });
  return light_integrals_;
}

std::vector<LinearForm> ViewPcaDecoder::LightHarmonics(int n, const Eigen::Vector3d& view) const {
  assert(IsShFunctionCount(n));
  std::vector<LinearForm> forms(n);
  if (view.z() <= 0.0) {
    return forms;
  }
  std::vector<int> all(num_lights_);
  std::iota(all.begin(), all.end(), 0);
  for (int i = 0; i < n; ++i) {
    forms[i] = FormOf(all, std::span(LightIntegrals().col(i).data(), all.size()), view);
  }
  return forms;
}

LinearForm ViewPcaDecoder::FormOf(std::span<const int> lights, std::span<const double> light_weights,
                                  const Eigen::Vector3d& view) const {
  LinearForm form;
  const BarycentricWeights v = views_.Locate(view);
  const double scale = std::accumulate(light_weights.begin(), light_weights.end(), 0.0);
  const int run = num_eigen_textures_ + 1;
  std::vector<double> weights(run);
  for (int s = 0; s < 3; ++s) {
    if (v.weight[s] == 0.0) {
      continue;
    }
    weights[0] = scale * v.weight[s];
    for (int m = 0; m < num_eigen_textures_; ++m) {
      double sum = 0.0;
      for (size_t r = 0; r < lights.size(); ++r) {
        const size_t row = static_cast<size_t>(v.index[s]) * num_lights_ + lights[r];
        sum += light_weights[r] * light_weights_[row * num_eigen_textures_ + m];
      }
      weights[m + 1] = v.weight[s] * sum;
    }
    for (int channel = 0; channel < 3; ++channel) {
      form.runs.push_back({channel, (v.index[s] * 3 + channel) * run, run});
      form.weights.insert(form.weights.end(), weights.begin(), weights.end());
    }
  }
  return form;
}

}  // namespace tessera
