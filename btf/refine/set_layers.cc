#include "btf/refine/set_layers.h"

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_tables.h"
#include "btf/codec/decoder.h"
#include "btf/math/truncated_svd.h"
#include "btf/refine/scene_cases.h"

namespace tessera {
namespace {

// Of which components are the principal ones: more than errors are measured over, or they would fit those
// alone.
constexpr int kLightsPerView = 8;
constexpr float kFirstStep = 1.0F / 16.0F;
// What a step leaves lies evenly within half of it on either side: thirds of it spend their bits best.
constexpr float kStepRatio = 3.0F;
constexpr float kLastStep = 1.0F / 4096.0F;
// The first of the components that so many blocks make matter most, and are found best.
constexpr int kBlocks = 4;
constexpr Eigen::Index kBlockComponents = kMostComponents / kBlocks;
// Components and tables are as exact as images of this step, so that later layers need not mend them.
constexpr float kSharedStep = 1.0F / 1024.0F;
// Tables with fewer entries for a coefficient hold offsets and steps, which are not rounded.
constexpr size_t kLeastRoundedEntries = 16;
// Codes are 0 up to this many steps more than one half: small ones cost more than they save.
constexpr double kDeadZone = 0.1;
// Squared error that a byte of images saves, in squares of the step: twice ln 2 a bit, of step^2 / 12.
constexpr double kSquaresPerByte = 0.92;
constexpr double kBytesPerBasisCode = 0.6;
constexpr double kBytesPerEntry = 0.5;
constexpr double kBytesPerComponent = 16.0;
constexpr size_t kRows = 1024;

// The principal components of some coefficients.
struct Components {
  FloatRows project;        // [coefficients][components]
  FloatRows basis;          // [components][coefficients]
  std::vector<float> size;  // [components], RMS of their images
};

FloatRows ColumnsOf(const FloatRows& from, std::span<const uint32_t> columns) {
  FloatRows to(from.rows(), static_cast<Eigen::Index>(columns.size()));
  for (size_t i = 0; i < columns.size(); ++i) {
    to.col(static_cast<Eigen::Index>(i)) = from.col(columns[i]);
  }
  return to;
}

// At most `most` components. `values` [BTFels][coefficients] have a mean of 0, `weights` is
// [cases][coefficients].
Components PrincipalComponents(const FloatRows& values, const FloatRows& weights, size_t most) {
  const FloatRows reflected = values * weights.transpose();
  BlockLanczos lanczos(reflected.cols(), std::min(kBlockComponents, reflected.cols()), /*seed=*/1);
  for (int i = 0; i < kBlocks && !lanczos.is_complete(); ++i) {
    const Eigen::MatrixXf product = reflected.transpose() * (reflected * lanczos.block());
    lanczos.Add(product);
  }
  const SingularSpace leading = lanczos.Leading(static_cast<Eigen::Index>(most));
  Eigen::Index count = 0;
  const double rows = std::max<double>(1.0, static_cast<double>(values.rows()));
  while (count < leading.values.size() && leading.values[count] > kLastStep * std::sqrt(rows)) {
    ++count;
  }
  Components components;
  components.project = weights.transpose() * leading.vectors.leftCols(count).cast<float>();
  const FloatRows images = values * components.project;
  components.basis = images.transpose() * values;
  for (Eigen::Index c = 0; c < count; ++c) {
    const float squares = std::max(images.col(c).squaredNorm(), 1e-30F);
    components.basis.row(c) /= squares;
    components.size.push_back(std::sqrt(squares / static_cast<float>(rows)));
  }
  return components;
}

// The layers so far, and what more may come.
class LayerCoder {
 public:
  static absl::StatusOr<LayerCoder> Create(const BtfelTable& table, const SetLayersOptions& options,
                                           const RunContext& context) {
    LayerCoder coder(table, options);
    TESSERA_RETURN_IF_ERROR(coder.Measure());
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    return coder;
  }

  absl::StatusOr<SetLayers> Run(const RunContext& context) {
    for (float step = kFirstStep; step >= kLastStep && rmse_ > kLayersEndRmse; step /= kStepRatio) {
      if (!taken_.empty()) {
        TESSERA_RETURN_IF_ERROR(AddLayer(step, Brings::kFinerImages, context));
      }
      TESSERA_RETURN_IF_ERROR(AddLayer(step, Brings::kComponents, context));
    }
    result_.layers = std::make_shared<const TileSetLayers>(std::move(layers_));
    return std::move(result_);
  }

 private:
  enum class Brings { kFinerImages, kComponents };

  // A component that may come: its coefficients' layer, its basis, its image's cosines [frequency][block].
  struct Candidate {
    uint32_t span = 0;
    float basis_step = 0.0F;
    std::vector<int32_t> basis;
    std::vector<float> cosines;
  };

  LayerCoder(const BtfelTable& table, const SetLayersOptions& options)
      : table_(table),
        options_(options),
        frequencies_(BlockFrequencies(options.block_side)),
        transform_(options.block_side),
        rmse_(options.rmse) {}

  [[nodiscard]] size_t num_btfels() const { return table_.size(); }
  [[nodiscard]] size_t num_blocks() const { return table_.size() / frequencies_.size(); }
  [[nodiscard]] size_t most_components() const {
    return std::min(kMostLayerComponents, kMostLayerValues / std::max<size_t>(num_btfels(), 1));
  }

  absl::Status Measure() {
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table_));
    TESSERA_ASSIGN_OR_RETURN(tables_, CoefficientTables::Of(table_));
    weights_ = MakeSceneCases(*decoder, table_, options_.light, kLightsPerView).weights;
    error_weights_ = MakeSceneCases(*decoder, table_, options_.light).weights;
    held_.assign(static_cast<size_t>(table_.num_coefficients), false);
    for (const uint32_t coefficient : options_.exact) {
      held_[coefficient] = true;
    }
    const std::vector<size_t> sampled = Spread(num_btfels(), kRefineBtfels);
    sampled_.assign(sampled.begin(), sampled.end());
    values_ = CoefficientsOf(table_, sampled);
    whole_ = values_ * error_weights_.transpose();
    layers_.block_side = options_.block_side;
    if (options_.exact.empty()) {
      TESSERA_RETURN_IF_ERROR(RoundTables());
    }
    const Eigen::RowVectorXf mean = values_.colwise().mean();
    layers_.mean.assign(mean.begin(), mean.end());
    values_.rowwise() -= mean;
    weights_ /= std::sqrt(static_cast<float>(std::max<Eigen::Index>(weights_.rows(), 1)));
    const Eigen::RowVectorXf weight = weights_.colwise().norm();
    for (const float each : weight) {
      layers_.scale.push_back(each > 0.0F ? 1.0F / each : 0.0F);
    }
    // In the mean over BTFels and cases: squares of the coefficient's mean, and of what differs from it.
    mean_squares_ = mean.cwiseAbs2().cwiseProduct(weight.cwiseAbs2());
    squares_ = values_.colwise().squaredNorm().cwiseProduct(weight.cwiseAbs2()) /
               static_cast<float>(std::max<Eigen::Index>(values_.rows(), 1));
    return absl::OkStatus();
  }

  // The table with the entries of each coefficient rounded to multiples of 2^bits, of f32 in the last place.
  [[nodiscard]] CodecTable Rounded(const std::string& name, const CodecTable& table,
                                   std::span<const int> bits) const {
    CodecTable rounded = table;
    std::vector<int> of_entry(table.values.size(), std::numeric_limits<int>::max());
    for (uint32_t c = 0; c < bits.size(); ++c) {
      for (const int64_t entry : tables_->EntriesOf(name, std::span(&c, 1), {})) {
        int& least = of_entry[static_cast<size_t>(entry)];
        least = std::min(least, bits[c]);
      }
    }
    for (size_t i = 0; i < of_entry.size(); ++i) {
      float& value = rounded.values[i];
      if (of_entry[i] == std::numeric_limits<int>::max() || value == 0.0F) {
        continue;
      }
      const int last_place = table.dtype == DType::kF32 ? std::ilogb(value) - (FLT_MANT_DIG - 1) : 0;
      const double unit = std::ldexp(1.0, last_place + of_entry[i]);
      const double most =
          table.dtype == DType::kF32 ? FLT_MAX : std::ldexp(1.0, 8 * DTypeSize(table.dtype)) - unit;
      value = static_cast<float>(std::min(std::round(value / unit), std::floor(most / unit)) * unit);
    }
    return rounded;
  }

  // Tables rounded so that each coefficient errs by about kSharedStep's error, and the weights that they
  // give. The error grows as the unit does: rounding a little tells how much more is allowed.
  absl::Status RoundTables() {
    BtfelTable table = table_.WithoutCodes();
    std::map<std::string, CodecTable>& rounded = layers_.tables;
    std::vector<std::string> names;
    for (const auto& [name, codec_table] : table.tables) {
      if (tables_->IsSplit(name) && codec_table.values.size() >= kLeastRoundedEntries * held_.size()) {
        names.push_back(name);
      }
    }
    if (names.empty()) {
      return absl::OkStatus();
    }
    const Eigen::RowVectorXf size =
        (values_.colwise().squaredNorm() / static_cast<float>(values_.rows())).cwiseSqrt();
    std::vector<int> bits(held_.size(), 3);
    for (const bool is_trial : {true, false}) {
      for (const std::string& name : names) {
        const CodecTable& exact = table_.tables.at(name);
        rounded[name] = Rounded(name, exact, bits);
        table.tables[name] = rounded[name];
      }
      TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table));
      const FloatRows weights = MakeSceneCases(*decoder, table, options_.light, kLightsPerView).weights;
      if (is_trial) {
        const float allowed = kSharedStep / std::sqrt(12.0F);
        for (size_t c = 0; c < bits.size(); ++c) {
          const auto column = static_cast<Eigen::Index>(c);
          const float error = size[column] * (weights.col(column) - weights_.col(column)).norm() /
                              std::sqrt(static_cast<float>(weights.rows()));
          bits[c] += error > 0.0F ? static_cast<int>(std::floor(std::log2(allowed / error))) : 0;
          bits[c] = std::clamp(bits[c], 0, 20);
        }
      } else {
        weights_ = weights;
        error_weights_ = MakeSceneCases(*decoder, table, options_.light).weights;
      }
    }
    return absl::OkStatus();
  }

  // Those that need no entries in the first layer, the others once they are worth them.
  [[nodiscard]] std::vector<uint32_t> NewCoefficients(float step) const {
    std::vector<uint32_t> coefficients;
    for (uint32_t c = 0; c < held_.size(); ++c) {
      if (held_[c]) {
        continue;
      }
      if (!tables_->NeedsEntries(c)) {
        coefficients.push_back(c);
        continue;
      }
      double entries = 0.0;
      for (const auto& [name, table] : table_.tables) {
        if (tables_->IsSplit(name)) {
          entries += static_cast<double>(tables_->EntriesOf(name, std::span(&c, 1), {}).size());
        }
      }
      const double saved =
          mean_squares_[c] + std::max(0.0, static_cast<double>(squares_[c]) - step * step / 12.0);
      if (saved * static_cast<double>(num_btfels()) >
          kSquaresPerByte * step * step * kBytesPerEntry * entries) {
        coefficients.push_back(c);
      }
    }
    return coefficients;
  }

  // The components of these coefficients, with their images over all BTFels.
  absl::Status AddCandidates(std::span<const uint32_t> coefficients, uint32_t span,
                             const RunContext& context) {
    const Components found =
        PrincipalComponents(ColumnsOf(values_, coefficients), ColumnsOf(weights_, coefficients),
                            std::min<size_t>(kMostComponents, most_components()));
    const Eigen::Index count = found.project.cols();
    Eigen::RowVectorXf mean(static_cast<Eigen::Index>(coefficients.size()));
    for (size_t i = 0; i < coefficients.size(); ++i) {
      mean[static_cast<Eigen::Index>(i)] = layers_.mean[coefficients[i]];
    }
    FloatRows images(static_cast<Eigen::Index>(num_btfels()), count);
    for (size_t begin = 0; begin < num_btfels(); begin += kRows) {
      TESSERA_RETURN_IF_ERROR(context.CheckStop());
      std::vector<size_t> btfels(std::min(kRows, num_btfels() - begin));
      std::iota(btfels.begin(), btfels.end(), begin);
      FloatRows values = ColumnsOf(CoefficientsOf(table_, btfels), coefficients);
      values.rowwise() -= mean;
      images.middleRows(static_cast<Eigen::Index>(begin), values.rows()) = values * found.project;
    }
    for (Eigen::Index c = 0; c < count; ++c) {
      Candidate candidate{.span = span};
      // So that all its codes together err as an image of kSharedStep does.
      candidate.basis_step =
          kSharedStep / (found.size[c] * std::sqrt(static_cast<float>(coefficients.size())));
      for (size_t i = 0; i < coefficients.size(); ++i) {
        const float scale = layers_.scale[coefficients[i]];
        const float code = scale > 0.0F
                               ? found.basis(c, static_cast<Eigen::Index>(i)) / (scale * candidate.basis_step)
                               : 0.0F;
        candidate.basis.push_back(static_cast<int32_t>(std::lround(code)));
      }
      const Eigen::VectorXf image = images.col(c);
      candidate.cosines = transform_.Forward(std::span(image.data(), num_btfels()));
      candidates_.push_back(std::move(candidate));
    }
    return absl::OkStatus();
  }

  // Codes of what is left of the cosines, [frequency][block], and the squared error that they save.
  [[nodiscard]] std::pair<std::vector<int32_t>, double> Coded(std::span<const float> wanted,
                                                              std::span<const float> held, float step) const {
    std::vector<int32_t> codes(wanted.size());
    double saved = 0.0;
    for (size_t i = 0; i < wanted.size(); ++i) {
      const double unit = step * StepFactor(frequencies_[i / num_blocks()], options_.block_side);
      const double left = wanted[i] - (held.empty() ? 0.0F : held[i]);
      const double size = std::floor(std::abs(left) / unit + 0.5 - kDeadZone);
      codes[i] = static_cast<int32_t>(std::copysign(size, left));
      saved += left * left - (left - codes[i] * unit) * (left - codes[i] * unit);
    }
    return {std::move(codes), saved};
  }

  // One of this step, where it lowers the error.
  absl::Status AddLayer(float step, Brings brings, const RunContext& context) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    TileSetLayer layer{.step = step};
    if (brings == Brings::kComponents) {
      layer.coefficients = NewCoefficients(step);
    }
    const size_t candidates_before = candidates_.size();
    if (!layer.coefficients.empty()) {
      TESSERA_RETURN_IF_ERROR(
          AddCandidates(layer.coefficients, static_cast<uint32_t>(layers_.layers.size()), context));
    }
    LayerSum sum =
        sum_.has_value() ? *sum_ : LayerSum(options_.block_side, num_blocks(), layers_.mean, layers_.scale);
    for (size_t c = 0; c < taken_.size(); ++c) {
      const auto codes = brings == Brings::kFinerImages
                             ? Coded(candidates_[taken_[c]].cosines, sum.cosines(c), step).first
                             : std::vector<int32_t>(num_btfels(), 0);
      layer.codes.insert(layer.codes.end(), codes.begin(), codes.end());
    }
    std::vector<size_t> taken = taken_;
    for (size_t c = 0; c < candidates_.size() && taken.size() < most_components(); ++c) {
      if (brings == Brings::kFinerImages || std::ranges::find(taken_, c) != taken_.end()) {
        continue;
      }
      const Candidate& candidate = candidates_[c];
      const auto [codes, saved] = Coded(candidate.cosines, {}, step);
      const double bytes =
          kBytesPerComponent + kBytesPerBasisCode * static_cast<double>(candidate.basis.size());
      if (saved > kSquaresPerByte * step * step * bytes) {
        taken.push_back(c);
        layer.spans.push_back(candidate.span);
        layer.basis_step.push_back(candidate.basis_step);
        layer.basis.insert(layer.basis.end(), candidate.basis.begin(), candidate.basis.end());
        layer.codes.insert(layer.codes.end(), codes.begin(), codes.end());
      }
    }
    TESSERA_RETURN_IF_ERROR(sum.Add(layer));
    const auto hold = [&](bool held) {
      for (const uint32_t coefficient : layer.coefficients) {
        held_[coefficient] = held;
      }
    };
    hold(true);
    const double rmse = RmseOf(ReflectedBy(sum), whole_);
    // A first layer without coefficients that mean anything would be black.
    const bool is_first = layers_.layers.empty() && options_.exact.empty();
    const bool is_last_chance = is_first && step / kStepRatio < kLastStep;
    const bool is_worth_it = is_first ? !layer.coefficients.empty() || is_last_chance : rmse < rmse_;
    if (!is_worth_it) {
      hold(false);
      candidates_.resize(candidates_before);
      return absl::OkStatus();
    }
    taken_ = std::move(taken);
    sum_ = std::move(sum);
    layers_.layers.push_back(std::move(layer));
    rmse_ = rmse;
    result_.rmse.push_back(rmse);
    return absl::OkStatus();
  }

  // What the sampled BTFels reflect: coefficients that are not here have no entries, and reflect nothing.
  [[nodiscard]] FloatRows ReflectedBy(const LayerSum& sum) const {
    const std::vector<float> sums = sum.Coefficients(sampled_);
    FloatRows values = Eigen::Map<const FloatRows>(sums.data(), values_.rows(), values_.cols());
    for (uint32_t c = 0; c < held_.size(); ++c) {
      if (!held_[c]) {
        values.col(c).setZero();
      }
    }
    for (const uint32_t c : options_.exact) {
      values.col(c) = values_.col(c).array() + layers_.mean[c];
    }
    return values * error_weights_.transpose();
  }

  const BtfelTable& table_;
  SetLayersOptions options_;
  std::vector<BlockFrequency> frequencies_;
  BlockCosines transform_;
  std::optional<CoefficientTables> tables_;
  std::vector<uint32_t> sampled_;
  FloatRows weights_;        // [3 * cases][k], over the root of their number
  FloatRows error_weights_;  // of the cases over which errors are measured, as they are
  FloatRows values_;         // [sampled][k], less the mean
  FloatRows whole_;          // [sampled][3 * cases], what they reflect
  Eigen::RowVectorXf mean_squares_;
  Eigen::RowVectorXf squares_;
  std::vector<bool> held_;             // [k]
  std::vector<Candidate> candidates_;  // of the coefficients held
  std::vector<size_t> taken_;          // [component], the candidate that it is
  std::optional<LayerSum> sum_;
  TileSetLayers layers_;
  double rmse_;
  SetLayers result_;
};

}  // namespace

absl::StatusOr<SetLayers> MakeSetLayers(const BtfelTable& table, const SetLayersOptions& options,
                                        const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(LayerCoder coder, LayerCoder::Create(table, options, context));
  return coder.Run(context);
}

}  // namespace tessera
