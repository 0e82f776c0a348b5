#include "btf/refine/refinement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>

#include <absl/strings/str_cat.h>
#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_tables.h"
#include "btf/codec/decoder.h"
#include "btf/math/conventions.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

// Of the coefficients, the first prefix; each further one is kPrefixGrowth times as long.
constexpr double kFirstShare = 1.0 / 32.0;
constexpr double kPrefixGrowth = 1.41421356237;
constexpr int kSkyFunctions = 9;

using FloatMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

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

  [[nodiscard]] Eigen::Map<const FloatMatrix> matrix() const {
    return {values_.data(), static_cast<Eigen::Index>(values_.size() / k_), static_cast<Eigen::Index>(k_)};
  }

 private:
  size_t k_;
  std::vector<float> values_;
};

std::vector<size_t> Spread(size_t count, size_t most) {
  const size_t taken = std::min(count, most);
  std::vector<size_t> indices(taken);
  for (size_t i = 0; i < taken; ++i) {
    indices[i] = (2 * i + 1) * count / (2 * taken);
  }
  return indices;
}

void AddPointCases(const Decoder& decoder, const BtfelTable& table, CaseWeights& weights) {
  const size_t num_lights = table.lights.size();
  const std::vector<size_t> views = Spread(table.views.size(), kRefineViews);
  // Steps of the golden section visit the lights evenly, whatever their order.
  constexpr double kGoldenSection = 0.6180339887498949;
  double at = 0.5;
  for (const size_t view : views) {
    for (int i = 0; i < 2; ++i) {
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

std::vector<uint32_t> PrefixEnds(size_t k) {
  std::vector<uint32_t> ends;
  for (double end = std::max(1.0, std::ceil(kFirstShare * static_cast<double>(k)));
       end < static_cast<double>(k); end = std::max(std::ceil(end * kPrefixGrowth), end + 1.0)) {
    ends.push_back(static_cast<uint32_t>(end));
  }
  ends.push_back(static_cast<uint32_t>(k));
  return ends;
}

// Coefficients [texels][k] of texels spread over the tiles.
absl::StatusOr<FloatMatrix> SampledCoefficients(const TileSet& tile_set) {
  const BtfelTable& table = tile_set.btfels;
  const std::vector<size_t> texels = Spread(tile_set.tile_index.size(), kRefineTexels);
  FloatMatrix values(texels.size(), table.num_coefficients);
  for (size_t row = 0; row < texels.size(); ++row) {
    const uint32_t btfel = BtfelOfTexel(tile_set.tile_index[texels[row]]);
    if (btfel >= table.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("texel ", texels[row], " names BTFel ", btfel, " of ", table.size()));
    }
    const auto codes = table.btfel(btfel);
    for (size_t i = 0; i < codes.size(); ++i) {
      values(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(i)) =
          table.offset[i] + table.step[i] * static_cast<float>(codes[i]);
    }
  }
  return values;
}

// Means over the texels, 0 where a coefficient needs entries of tables; the values become differences to
// them.
absl::StatusOr<std::vector<float>> TakeFill(const BtfelTable& table, FloatMatrix& values) {
  CoefficientTables::Shapes shapes;
  for (const auto& [name, codec_table] : table.tables) {
    shapes[name] = codec_table.shape;
  }
  TESSERA_ASSIGN_OR_RETURN(const CoefficientTables tables,
                           CoefficientTables::Create(table.codec_id, table.num_coefficients, shapes));
  std::vector<float> fill(values.cols(), 0.0F);
  for (Eigen::Index i = 0; i < values.cols(); ++i) {
    if (!tables.NeedsEntries(static_cast<uint32_t>(i)) && values.rows() > 0) {
      fill[i] = static_cast<float>(values.col(i).cast<double>().mean());
      values.col(i).array() -= fill[i];
    }
  }
  return fill;
}

// The columns of `from` in this order.
FloatMatrix Permuted(const Eigen::Ref<const FloatMatrix>& from, std::span<const uint32_t> order) {
  FloatMatrix to(from.rows(), from.cols());
  for (size_t i = 0; i < order.size(); ++i) {
    to.col(static_cast<Eigen::Index>(i)) = from.col(order[i]);
  }
  return to;
}

double RmseOf(const FloatMatrix& value, const FloatMatrix& whole) {
  const double squares = (value.array().max(0.0F) - whole.array().max(0.0F)).square().cast<double>().sum();
  return whole.size() == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(whole.size()));
}

}  // namespace

absl::StatusOr<Refinement> MakeRefinement(const TileSet& tile_set, SceneLight light,
                                          const RunContext& context) {
  const BtfelTable& table = tile_set.btfels;
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table));
  const auto k = static_cast<size_t>(table.num_coefficients);
  CaseWeights cases(table.num_coefficients);
  Refinement refinement;
  const size_t num_views = std::min(table.views.size(), static_cast<size_t>(kRefineViews));
  if (light == SceneLight::kPoint) {
    AddPointCases(*decoder, table, cases);
    refinement.directions = absl::StrCat(num_views, " measured views with 2 measured lights each");
  } else {
    AddSkyCases(*decoder, table, cases);
    refinement.directions = absl::StrCat(num_views, " measured views in 5 soft lights");
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  TESSERA_ASSIGN_OR_RETURN(FloatMatrix values, SampledCoefficients(tile_set));
  TESSERA_ASSIGN_OR_RETURN(refinement.fill, TakeFill(table, values));

  std::vector<double> energy(k);
  for (size_t i = 0; i < k; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    energy[i] = cases.matrix().col(column).cast<double>().squaredNorm() *
                values.col(column).cast<double>().squaredNorm();
  }
  refinement.order.resize(k);
  std::iota(refinement.order.begin(), refinement.order.end(), 0U);
  std::ranges::stable_sort(refinement.order, [&](uint32_t a, uint32_t b) { return energy[a] > energy[b]; });

  // [texels][3 * cases]: first of the fill alone, then of more and more coefficients.
  const Eigen::Map<const Eigen::RowVectorXf> fill(refinement.fill.data(), static_cast<Eigen::Index>(k));
  const FloatMatrix base = (fill * cases.matrix().transpose()).replicate(values.rows(), 1);
  const FloatMatrix weights = Permuted(cases.matrix(), refinement.order);
  values = Permuted(values, refinement.order);
  FloatMatrix whole = base;
  whole.noalias() += values * weights.transpose();
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  FloatMatrix value = base;
  uint32_t begin = 0;
  double last = INFINITY;
  for (const uint32_t end : PrefixEnds(k)) {
    const Eigen::Index columns = end - begin;
    value.noalias() += values.middleCols(begin, columns) * weights.middleCols(begin, columns).transpose();
    begin = end;
    const double rmse = end == k ? 0.0 : RmseOf(value, whole);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (rmse < last || end == k) {
      refinement.ends.push_back(end);
      refinement.rmse.push_back(rmse);
      last = rmse;
    }
  }
  return refinement;
}

}  // namespace tessera
