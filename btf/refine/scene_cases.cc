#include "btf/refine/scene_cases.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>

#include <absl/strings/str_cat.h>

#include "btf/math/conventions.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

constexpr int kSkyFunctions = 9;
constexpr double kGoldenSection = 0.6180339887498949;

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

std::vector<size_t> Scatter(size_t count, size_t most) {
  std::vector<size_t> indices;
  double share = 0.5;
  for (size_t i = 0; i < std::min(count, most); ++i) {
    indices.push_back(std::min(static_cast<size_t>(share * static_cast<double>(count)), count - 1));
    share = std::fmod(share + kGoldenSection, 1.0);
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

SampledTexels SampleTexels(const TileSet& tile_set, int level) {
  const std::optional<SourceGrid> grid = SourceGridOf(tile_set);
  const int side = std::max((1 << level) / (grid.has_value() ? grid->footprint : 1), 1);
  const auto across = static_cast<size_t>(tile_set.tile_size / side);
  SampledTexels sampled{.btfels = {}, .per_row = static_cast<size_t>(side) * static_cast<size_t>(side)};
  for (const size_t at : Scatter(tile_set.tile_codes.size() * across * across, kRefineTexels)) {
    const auto tile = static_cast<int>(at / (across * across));
    const int left = static_cast<int>(at % across) * side;
    const int top = static_cast<int>(at / across % across) * side;
    for (int i = 0; i < side * side; ++i) {
      sampled.btfels.push_back(BtfelOfTexel(tile_set.texel(tile, left + i % side, top + i / side)));
    }
  }
  return sampled;
}

FloatRows CoefficientsOf(const BtfelTable& table, std::span<const uint32_t> btfels, size_t per_row) {
  FloatRows values =
      FloatRows::Zero(static_cast<Eigen::Index>(btfels.size() / per_row), table.num_coefficients);
  for (size_t i = 0; i < btfels.size(); ++i) {
    const auto codes = table.btfel(btfels[i]);
    auto row = values.row(static_cast<Eigen::Index>(i / per_row));
    for (size_t c = 0; c < codes.size(); ++c) {
      row[static_cast<Eigen::Index>(c)] += static_cast<float>(codes[c]);
    }
  }
  const auto k = static_cast<Eigen::Index>(table.step.size());
  const Eigen::Map<const Eigen::RowVectorXf> step(table.step.data(), k);
  const Eigen::Map<const Eigen::RowVectorXf> offset(table.offset.data(), k);
  values = values.array().rowwise() * (step / static_cast<float>(per_row)).array();
  values.rowwise() += offset;
  return values;
}

double RmseOf(const FloatRows& values, const FloatRows& whole) {
  const double squares = (values.array().max(0.0F) - whole.array().max(0.0F)).square().cast<double>().sum();
  return whole.size() == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(whole.size()));
}

}  // namespace tessera
