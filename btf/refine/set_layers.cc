#include "btf/refine/set_layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_tables.h"
#include "btf/codec/decoder.h"
#include "btf/math/truncated_svd.h"
#include "btf/refine/core_coder.h"
#include "btf/refine/scene_cases.h"

namespace tessera {
namespace {

// Of which components are the principal ones: more than errors are measured over, or they would fit those
// alone.
constexpr int kLightsPerView = 8;
constexpr float kFirstStep = 1.0F / 16.0F;
// What a step leaves lies evenly within half of it on either side: thirds of it spend their bits best.
constexpr float kStepRatio = 3.0F;
constexpr float kLastStep = 1.0F / 16384.0F;
// The first of the components that so many blocks make matter most, and are found best.
constexpr int kBlocks = 6;
constexpr Eigen::Index kBlockComponents = kMostComponents / kBlocks;
// Components and tables are as exact as images of this step, so that later layers need not mend them.
constexpr float kSharedStep = 1.0F / 1024.0F;
// Squared error that a byte of images saves, in squares of the step: twice ln 2 a bit, of step^2 / 12.
constexpr double kSquaresPerByte = 0.92;
constexpr double kBytesPerBasisCode = 0.6;
constexpr double kBytesPerComponent = 16.0;
// An error that is the same all over the tiles changes their colour, and is seen so many times better than
// what differs from texel to texel.
constexpr double kMeanWeight = 4.0;
// Finer cores would be lost among kLayersEndRmse.
constexpr float kLeastCoreStep = 0.0005F;
// Whole numbers of a table: few, but more than rounding hides.
constexpr float kTrial = 8.0F;
constexpr size_t kRows = 1024;
// Few enough blocks that smooth images need few cosines, and small enough ones for their transform to be
// quick.
constexpr int kBlockSide = 64;

// The principal components of some coefficients.
struct Components {
  FloatRows project;        // [coefficients][components]
  FloatRows basis;          // [components][coefficients]
  std::vector<float> size;  // [components], RMS of their images
};

FloatRows ColumnsOf(const FloatRows& from, std::span<const uint32_t> columns) {
  FloatRows to(from.rows(), static_cast<Eigen::Index>(columns.size()));
  for (Eigen::Index row = 0; row < from.rows(); ++row) {
    for (size_t i = 0; i < columns.size(); ++i) {
      to(row, static_cast<Eigen::Index>(i)) = from(row, columns[i]);
    }
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

LayerBlocks BlocksOfSet(const TileSet& tile_set, int level) {
  const BtfelLabels labels = LabelsOf(tile_set);
  return BlocksOf(labels.pixels, labels.grid, labels.are_pixels ? kBlockSide : 1, level);
}

// Pixels of blocks that no BTFel has: what is best there is what costs fewest cosines, so values go on into
// them from all sides.
class Gaps {
 public:
  explicit Gaps(const LayerBlocks& blocks) {
    const auto side = static_cast<uint32_t>(blocks.side);
    std::vector<bool> is_known(blocks.num_pixels(), false);
    for (const uint32_t place : blocks.places) {
      is_known[place] = true;
    }
    std::vector<uint32_t> last(blocks.places.begin(), blocks.places.end());
    while (!last.empty()) {
      std::vector<uint32_t> found;
      for (const uint32_t place : last) {
        ForNeighbours(place, side, [&](uint32_t neighbour) {
          if (!is_known[neighbour]) {
            found.push_back(neighbour);
          }
        });
      }
      std::ranges::sort(found);
      found.erase(std::ranges::unique(found).begin(), found.end());
      for (const uint32_t place : found) {
        Gap gap{.place = place};
        ForNeighbours(place, side, [&](uint32_t neighbour) {
          if (is_known[neighbour]) {
            gap.from[gap.count++] = neighbour;
          }
        });
        gaps_.push_back(gap);
      }
      for (const uint32_t place : found) {
        is_known[place] = true;
      }
      last = std::move(found);
    }
  }

  // `image` is [pixels of blocks].
  void Fill(std::vector<float>& image) const {
    for (const Gap& gap : gaps_) {
      float sum = 0.0F;
      for (size_t i = 0; i < gap.count; ++i) {
        sum += image[gap.from[i]];
      }
      image[gap.place] = sum / static_cast<float>(gap.count);
    }
  }

 private:
  // Its value is the mean of those of `from`.
  struct Gap {
    uint32_t place = 0;
    size_t count = 0;
    std::array<uint32_t, 4> from = {};
  };

  template <typename Body>
  static void ForNeighbours(uint32_t place, uint32_t side, const Body& body) {
    const uint32_t x = place % side;
    const uint32_t y = place / side % side;
    if (x > 0) {
      body(place - 1);
    }
    if (x + 1 < side) {
      body(place + 1);
    }
    if (y > 0) {
      body(place - side);
    }
    if (y + 1 < side) {
      body(place + side);
    }
  }

  std::vector<Gap> gaps_;
};

// The layers so far, and what more may come.
class LayerCoder {
 public:
  static absl::StatusOr<LayerCoder> Create(const TileSet& tile_set, const SetLayersOptions& options,
                                           const RunContext& context) {
    LayerCoder coder(tile_set, options);
    TESSERA_RETURN_IF_ERROR(coder.Measure());
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    TESSERA_RETURN_IF_ERROR(coder.FindCandidates(context));
    return coder;
  }

  absl::StatusOr<SetLayers> Run(const RunContext& context) {
    for (float step = kFirstStep; step >= kLastStep && rmse_ > kLayersEndRmse; step /= kStepRatio) {
      const bool is_first = !sum_.has_value();
      TESSERA_RETURN_IF_ERROR(AddLayer(step, Brings::kComponents, context));
      if (!is_first) {
        TESSERA_RETURN_IF_ERROR(AddLayer(step, Brings::kFinerImages, context));
      }
    }
    result_.layers = std::make_shared<const TileSetLayers>(std::move(layers_));
    return std::move(result_);
  }

 private:
  enum class Brings { kFinerImages, kComponents };

  // A component that may come: its basis, its image's cosines [frequency][block].
  struct Candidate {
    float basis_step = 0.0F;
    std::vector<int32_t> basis;
    std::vector<float> cosines;
  };

  LayerCoder(const TileSet& tile_set, const SetLayersOptions& options)
      : table_(tile_set.btfels),
        options_(options),
        samples_(SampleTexels(tile_set, options.level)),
        blocks_(BlocksOfSet(tile_set, options.level)),
        gaps_(blocks_),
        factors_(blocks_.StepFactors()),
        transform_(blocks_.side),
        rmse_(options.rmse) {}

  [[nodiscard]] size_t num_btfels() const { return table_.size(); }
  // What of a squared error in cosines is one of BTFels.
  [[nodiscard]] double SquaredUnit(float step) const {
    return static_cast<double>(step) * step * blocks_.footprint * blocks_.footprint;
  }
  [[nodiscard]] size_t most_components() const {
    return std::min(kMostLayerComponents, kMostLayerValues / std::max<size_t>(blocks_.num_pixels(), 1));
  }

  absl::Status Measure() {
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table_));
    weights_ = MakeSceneCases(*decoder, table_, options_.light, kLightsPerView).weights;
    error_weights_ = MakeSceneCases(*decoder, table_, options_.light).weights;
    values_ = CoefficientsOf(table_, samples_.btfels, samples_.per_row);
    whole_ = values_ * error_weights_.transpose();
    layers_.block_side = blocks_.side;
    layers_.level = blocks_.level;
    if (options_.exact.empty()) {
      TESSERA_RETURN_IF_ERROR(MakeCores());
    }
    std::vector<bool> is_exact(static_cast<size_t>(table_.num_coefficients), false);
    for (const uint32_t coefficient : options_.exact) {
      is_exact[coefficient] = true;
    }
    for (uint32_t c = 0; c < is_exact.size(); ++c) {
      if (!is_exact[c]) {
        layers_.coefficients.push_back(c);
      }
    }
    const Eigen::RowVectorXf mean = values_.colwise().mean();
    layers_.mean.assign(mean.begin(), mean.end());
    values_.rowwise() -= mean;
    weights_ /= std::sqrt(static_cast<float>(std::max<Eigen::Index>(weights_.rows(), 1)));
    const Eigen::RowVectorXf weight = weights_.colwise().norm();
    for (const float each : weight) {
      layers_.scale.push_back(each > 0.0F ? 1.0F / each : 0.0F);
    }
    return absl::OkStatus();
  }

  // Tables by views and lights, each matrix by what an error in it costs: how far weights move where every
  // number of the tables moves by kTrial.
  absl::Status MakeCores() {
    TESSERA_ASSIGN_OR_RETURN(const CoefficientTables tables, CoefficientTables::Of(table_));
    std::vector<AngularTable> angular = AngularTablesOf(table_, tables);
    if (angular.empty()) {
      return absl::OkStatus();
    }
    BtfelTable trial = table_.WithoutCodes();
    for (const AngularTable& each : angular) {
      CodecTable& table = trial.tables.at(each.name);
      const float most = table.dtype == DType::kU8 ? 255.0F : 65535.0F;
      for (size_t i = 0; i < table.values.size(); ++i) {
        // Up and down without a pattern, and inwards where there is no room.
        const bool is_up = (i * size_t{2654435761} >> 16) % 2 == 0;
        float& value = table.values[i];
        value += (is_up || value < kTrial) && value + kTrial <= most ? kTrial : -kTrial;
      }
    }
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(trial));
    const FloatRows moved =
        MakeSceneCases(*decoder, trial, options_.light, kLightsPerView).weights - weights_;
    const Eigen::RowVectorXf size =
        (values_.colwise().squaredNorm() / static_cast<float>(values_.rows())).cwiseSqrt();
    std::vector<double> squares;
    for (const AngularTable& each : angular) {
      const size_t first = squares.size();
      squares.resize(first + each.num_matrices(), 0.0);
      const size_t angles = table_.views.size() * table_.lights.size();
      for (uint32_t c = 0; std::cmp_less(c, table_.num_coefficients); ++c) {
        std::set<size_t> matrices;
        for (const int64_t entry : tables.EntriesOf(each.name, std::span(&c, 1), {})) {
          const size_t cell = static_cast<size_t>(entry) / each.after_count;
          matrices.insert(cell / angles * each.after_count + static_cast<size_t>(entry) % each.after_count);
        }
        const auto column = static_cast<Eigen::Index>(c);
        const double error = static_cast<double>(size[column]) * moved.col(column).norm() / kTrial;
        for (const size_t matrix : matrices) {
          squares[first + matrix] +=
              error * error / static_cast<double>(moved.rows()) / static_cast<double>(matrices.size());
        }
      }
    }
    std::vector<double> costs(squares.size());
    std::ranges::transform(squares, costs.begin(), [](double square) { return std::sqrt(square); });
    TESSERA_ASSIGN_OR_RETURN(cores_, CoreCoder::Create(table_, std::move(angular), costs));
    layers_.bases = cores_->bases();
    return absl::OkStatus();
  }

  // The codes that make tables as fine as images of this step, and what errors weigh with these tables. A
  // number of a core is seen in the mean over so many others, as a cosine is over pixels, but the same all
  // over the tiles.
  absl::Status AddCores(float step, TileSetLayer& layer) {
    const double seen = std::sqrt(static_cast<double>(table_.views.size() * table_.lights.size()) /
                                  static_cast<double>(blocks_.num_pixels()));
    layer.core_step =
        std::max(kLeastCoreStep, step * static_cast<float>(blocks_.footprint * seen / kMeanWeight));
    layer.cores = cores_->Finer(layer.core_step);
    BtfelTable table = table_.WithoutCodes();
    cores_->sum().Write(table.tables);
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table));
    error_weights_ = MakeSceneCases(*decoder, table, options_.light).weights;
    return absl::OkStatus();
  }

  // The components, with their images over all BTFels.
  absl::Status FindCandidates(const RunContext& context) {
    const std::vector<uint32_t>& coefficients = layers_.coefficients;
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
      std::vector<uint32_t> btfels(std::min(kRows, num_btfels() - begin));
      std::iota(btfels.begin(), btfels.end(), static_cast<uint32_t>(begin));
      FloatRows values = ColumnsOf(CoefficientsOf(table_, btfels), coefficients);
      values.rowwise() -= mean;
      images.middleRows(static_cast<Eigen::Index>(begin), values.rows()) = values * found.project;
    }
    for (Eigen::Index c = 0; c < count; ++c) {
      Candidate candidate;
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
      std::vector<float> image(blocks_.num_pixels(), 0.0F);
      for (size_t btfel = 0; btfel < num_btfels(); ++btfel) {
        image[blocks_.places[btfel]] = images(static_cast<Eigen::Index>(btfel), c);
      }
      gaps_.Fill(image);
      candidate.cosines = transform_.Forward(image);
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
      const double unit = step * factors_[i / blocks_.size()];
      const double left = wanted[i] - (held.empty() ? 0.0F : held[i]);
      codes[i] = CodeOf(left, unit);
      saved += left * left - (left - codes[i] * unit) * (left - codes[i] * unit);
    }
    return {std::move(codes), saved};
  }

  // One of this step, where it lowers the error.
  absl::Status AddLayer(float step, Brings brings, const RunContext& context) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const bool is_first = !sum_.has_value();
    TileSetLayer layer{.step = step};
    LayerSum sum = is_first ? LayerSum(blocks_, layers_.coefficients, layers_.mean, layers_.scale) : *sum_;
    for (size_t c = 0; c < taken_.size(); ++c) {
      const auto codes = brings == Brings::kFinerImages
                             ? Coded(candidates_[taken_[c]].cosines, sum.cosines(c), step).first
                             : std::vector<int32_t>(blocks_.num_pixels(), 0);
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
      if (saved > kSquaresPerByte * SquaredUnit(step) * bytes) {
        taken.push_back(c);
        layer.basis_step.push_back(candidate.basis_step);
        layer.basis.insert(layer.basis.end(), candidate.basis.begin(), candidate.basis.end());
        layer.codes.insert(layer.codes.end(), codes.begin(), codes.end());
      }
    }
    TESSERA_RETURN_IF_ERROR(sum.Add(layer));
    std::optional<CoreCoder> cores = cores_;
    FloatRows error_weights = error_weights_;
    if (cores.has_value() && brings == Brings::kComponents) {
      TESSERA_RETURN_IF_ERROR(AddCores(step, layer));
    }
    const double rmse = RmseOf(ReflectedBy(sum), whole_);
    if (rmse >= rmse_) {
      cores_ = std::move(cores);
      error_weights_ = std::move(error_weights);
      return absl::OkStatus();
    }
    taken_ = std::move(taken);
    sum_ = std::move(sum);
    layers_.layers.push_back(std::move(layer));
    rmse_ = rmse;
    result_.rmse.push_back(rmse);
    return absl::OkStatus();
  }

  // What the sampled texels reflect.
  [[nodiscard]] FloatRows ReflectedBy(const LayerSum& sum) const {
    const std::vector<float> sums = sum.Coefficients(samples_.btfels, samples_.per_row);
    FloatRows values = Eigen::Map<const FloatRows>(sums.data(), values_.rows(), values_.cols());
    for (const uint32_t c : options_.exact) {
      values.col(c) = values_.col(c).array() + layers_.mean[c];
    }
    return values * error_weights_.transpose();
  }

  const BtfelTable& table_;
  SetLayersOptions options_;
  SampledTexels samples_;
  LayerBlocks blocks_;
  Gaps gaps_;
  std::vector<float> factors_;  // [frequency]
  BlockCosines transform_;
  FloatRows weights_;        // [3 * cases][k], over the root of their number
  FloatRows error_weights_;  // of the cases over which errors are measured, as they are
  FloatRows values_;         // [sampled][k], less the mean
  FloatRows whole_;          // [sampled][3 * cases], what they reflect
  std::optional<CoreCoder> cores_;
  std::vector<Candidate> candidates_;
  std::vector<size_t> taken_;  // [component], the candidate that it is
  std::optional<LayerSum> sum_;
  TileSetLayers layers_;
  double rmse_;
  SetLayers result_;
};

}  // namespace

absl::StatusOr<SetLayers> MakeSetLayers(const TileSet& tile_set, const SetLayersOptions& options,
                                        const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(LayerCoder coder, LayerCoder::Create(tile_set, options, context));
  return coder.Run(context);
}

}  // namespace tessera
