#include "btf/refine/scene_cases.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include <absl/strings/str_cat.h>

#include "btf/math/conventions.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

constexpr int kSkyFunctions = 9;

// Weights [3 * cases][k]: a row for each channel of each case.
class CaseWeights {
 public:
  explicit CaseWeights(int num_coefficients) : k_(num_coefficients) {}

  // sum over i of scales[i] times the value of forms[i].
  void Add(std::span<const LinearForm> forms, std::span<const double> scales) {
    std::vector<double> rows(3 * k_, 0.0);
    for (size_t f = 0; f < forms.size(); ++f) {
      const double* weight = forms[f].weights.data();
      for (const LinearForm::Run& run : forms[f].runs) {
        double* const to = rows.data() + run.channel * k_ + run.first;
        for (int i = 0; i < run.count; ++i) {
          to[i] += scales[f] * *weight++;
        }
      }
    }
    values_.insert(values_.end(), rows.begin(), rows.end());
  }

  [[nodiscard]] FloatRows matrix() const {
    return Eigen::Map<const FloatRows>(values_.data(), static_cast<Eigen::Index>(values_.size() / k_),
                                       static_cast<Eigen::Index>(k_));
  }

 private:
  size_t k_;
  std::vector<float> values_;
};

void AddPointCases(const Decoder& decoder, const BtfelTable& table, int lights_per_view,
                   CaseWeights& weights) {
  const size_t num_lights = table.lights.size();
  const std::vector<size_t> views = Spread(table.views.size(), kRefineViews);
  // Steps of the golden section visit the lights evenly, whatever their order.
  constexpr double kGoldenSection = 0.6180339887498949;
  double at = 0.5;
  for (const size_t view : views) {
    for (int i = 0; i < lights_per_view; ++i) {
      const auto light = std::min(static_cast<size_t>(at * static_cast<double>(num_lights)), num_lights - 1);
      const std::array<LinearForm, 1> form = {
          decoder.Form(VectorFromDirection(table.lights[light]), VectorFromDirection(table.views[view]))};
      weights.Add(form, std::array<double, 1>{1.0});
      at = std::fmod(at + kGoldenSection, 1.0);
    }
  }
}

void AddSkyCases(const Decoder& decoder, const BtfelTable& table, CaseWeights& weights) {
  // Degrees 0 to 2 of max(0, cos) [Ramamoorthi and Hanrahan 2001], which has the irradiance 2 pi / 3.
  constexpr std::array<double, 3> kLobe = {kPi, 2.0 * kPi / 3.0, kPi / 4.0};
  constexpr double kToIrradiancePi = 1.5;
  std::vector<std::array<double, kSkyFunctions>> skies;
  for (int sky = 0; sky < 5; ++sky) {
    const Direction from{sky == 0 ? 0.0 : kPi / 4.0, sky * kPi / 2.0};
    std::array<double, kSkyFunctions> values = {};
    EvaluateSh(VectorFromDirection(from), values);
    for (int i = 0; i < kSkyFunctions; ++i) {
      const int degree = i == 0 ? 0 : i < 4 ? 1 : 2;
      values[i] *= kLobe[degree] * kToIrradiancePi / kPi;
    }
    skies.push_back(values);
  }
  for (const size_t view : Spread(table.views.size(), kRefineViews)) {
    const std::vector<LinearForm> forms =
        decoder.LightHarmonics(kSkyFunctions, VectorFromDirection(table.views[view]));
    for (const auto& sky : skies) {
      weights.Add(forms, sky);
    }
  }
}

}  // namespace

std::vector<size_t> Spread(size_t count, size_t most) {
  const size_t taken = std::min(count, most);
  std::vector<size_t> indices(taken);
  for (size_t i = 0; i < taken; ++i) {
    indices[i] = (2 * i + 1) * count / (2 * taken);
  }
  return indices;
}

SceneCases MakeSceneCases(const Decoder& decoder, const BtfelTable& table, SceneLight light,
                          int lights_per_view) {
  CaseWeights cases(table.num_coefficients);
  const size_t num_views = std::min(table.views.size(), static_cast<size_t>(kRefineViews));
  if (light == SceneLight::kPoint) {
    AddPointCases(decoder, table, lights_per_view, cases);
    return {cases.matrix(),
            absl::StrCat(num_views, " measured views with ", lights_per_view, " measured lights each")};
  }
  AddSkyCases(decoder, table, cases);
  return {cases.matrix(), absl::StrCat(num_views, " measured views in 5 soft lights")};
}

FloatRows CoefficientsOf(const BtfelTable& table, const std::vector<size_t>& btfels) {
  FloatRows values(static_cast<Eigen::Index>(btfels.size()), table.num_coefficients);
  for (size_t row = 0; row < btfels.size(); ++row) {
    const auto codes = table.btfel(btfels[row]);
    for (size_t i = 0; i < codes.size(); ++i) {
      values(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(i)) =
          table.offset[i] + table.step[i] * static_cast<float>(codes[i]);
    }
  }
  return values;
}

double RmseOf(const FloatRows& values, const FloatRows& whole) {
  const double squares = (values.array().max(0.0F) - whole.array().max(0.0F)).square().cast<double>().sum();
  return whole.size() == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(whole.size()));
}

}  // namespace tessera
