#include "btf/codec/dfmf/dfmf_encoder.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/dfmf/angular_factors.h"
#include "btf/codec/dfmf/dfmf_decoder.h"
#include "btf/codec/dfmf/direction_grid.h"
#include "btf/codec/dsh/coefficient_store.h"
#include "btf/codec/dsh/dsh_fitter.h"
#include "btf/codec/quantize.h"
#include "btf/math/truncated_svd.h"

namespace tessera {
namespace {

using StridedMap = Eigen::Map<const Eigen::MatrixXf, 0, Eigen::OuterStride<>>;

// More rows at once gain nothing.
constexpr uint64_t kMaxRowBlockBytes = uint64_t{64} << 20;
constexpr int kLanczosPasses = 3;
constexpr uint64_t kSeed = 0x64666d66;
// What the container's header, alignment and shared numbers take beyond what is counted one by one.
constexpr uint64_t kHeaderBytes = 6144;

// The block of samples that a pass looks at, texel after texel [channel][view][light].
struct Block {
  int row = 0;
  int num_rows = 0;
  int64_t num_texels = 0;
  std::span<float> samples;
};

// Reads the source once for every pass, and counts rows over all of them.
class RowPasses {
 public:
  RowPasses(BtfSource& source, uint64_t block_bytes, int expected_passes, const RunContext& context)
      : source_(source), context_(context), source_context_(context), expected_(expected_passes) {
    const uint64_t row_bytes = source.SamplesPerRow() * sizeof(float);
    rows_per_block_ =
        static_cast<int>(std::clamp<uint64_t>(std::min(block_bytes, kMaxRowBlockBytes) / row_bytes, 1,
                                              static_cast<uint64_t>(source.info().height)));
    // One stage for the caller: the source's own rows are not told apart from their encoding.
    source_context_.progress = nullptr;
    // Not zeroed, the source fills it.
    buffer_ = std::make_unique_for_overwrite<float[]>(source.SamplesPerRow() * rows_per_block_);
  }

  absl::Status Run(const std::function<absl::Status(const Block&)>& visit) {
    const int height = source_.info().height;
    for (int row = 0; row < height; row += rows_per_block_) {
      context_.Report("encode", static_cast<uint64_t>(done_) * height + row,
                      static_cast<uint64_t>(std::max(expected_, done_ + 1)) * height, "rows");
      TESSERA_RETURN_IF_ERROR(context_.CheckStop());
      const int num_rows = std::min(rows_per_block_, height - row);
      const Block block{row, num_rows, static_cast<int64_t>(num_rows) * source_.info().width,
                        std::span(buffer_.get(), source_.SamplesPerRow() * num_rows)};
      TESSERA_RETURN_IF_ERROR(source_.ReadRows(row, num_rows, block.samples, source_context_));
      TESSERA_RETURN_IF_ERROR(visit(block));
      TESSERA_RETURN_IF_ERROR(context_.CheckStop());
    }
    ++done_;
    return absl::OkStatus();
  }
  void Finish() const {
    const uint64_t rows = static_cast<uint64_t>(done_) * source_.info().height;
    context_.Report("encode", rows, rows, "rows");
  }
  void ExpectMore(int passes) { expected_ += passes; }

 private:
  BtfSource& source_;
  const RunContext& context_;
  RunContext source_context_;
  int rows_per_block_ = 1;
  int expected_;
  int done_ = 0;
  std::unique_ptr<float[]> buffer_;
};

absl::Status CheckDirections(const std::vector<Direction>& directions, const char* name) {
  if (directions.empty() || std::cmp_greater(directions.size(), kMaxDfmfDirections)) {
    return absl::InvalidArgumentError(
        absl::StrCat("the BTF has ", directions.size(), " ", name, ", expected 1 to ", kMaxDfmfDirections));
  }
  for (size_t i = 0; i < directions.size(); ++i) {
    constexpr double kRounding = 1e-9;
    const Direction& d = directions[i];
    if (!std::isfinite(d.phi_rad) || !(d.theta_rad >= 0.0 && d.theta_rad <= kPi / 2.0 + kRounding)) {
      return absl::InvalidArgumentError(absl::StrCat(name, "[", i, "]: polar angle ", DegFromRad(d.theta_rad),
                                                     " degrees, azimuth ", DegFromRad(d.phi_rad),
                                                     ", expected a polar angle from 0 to 90"));
    }
  }
  return absl::OkStatus();
}

absl::Status CheckInput(const BtfInfo& info, const EncodeParams& params) {
  if (params.rank < 0 || params.rank > 2 * kMaxDfmfRank) {
    return absl::InvalidArgumentError(
        absl::StrCat("rank = ", params.rank, ", expected 1 to ", 2 * kMaxDfmfRank, ", or 0 for none"));
  }
  if (!(params.max_error >= 0.0 && std::isfinite(params.max_error))) {
    return absl::InvalidArgumentError(
        absl::StrCat("max_error = ", params.max_error, ", expected a finite number >= 0"));
  }
  if ((params.rank > 0) + (params.max_error > 0.0) + (params.max_bytes > 0) > 1) {
    return absl::InvalidArgumentError(absl::StrCat("rank = ", params.rank, ", max_error = ", params.max_error,
                                                   ", max_bytes = ", params.max_bytes,
                                                   ": at most one of them may be set"));
  }
  if (info.width < 1 || info.height < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("the BTF is ", info.width, "x", info.height, " texels, expected at least 1x1"));
  }
  TESSERA_RETURN_IF_ERROR(CheckDirections(info.views, "views"));
  return CheckDirections(info.lights, "lights");
}

// Names the first illegal sample of a block; OK when there is none.
absl::Status CheckSamples(const BtfInfo& info, const Block& block) {
  const auto it = std::ranges::find_if_not(block.samples, [](float f) { return std::abs(f) <= kMaxSample; });
  if (it == block.samples.end()) {
    return absl::OkStatus();
  }
  size_t index = static_cast<size_t>(it - block.samples.begin());
  const auto take = [&index](size_t extent) {
    const size_t value = index % extent;
    index /= extent;
    return value;
  };
  const size_t light = take(info.lights.size());
  const size_t view = take(info.views.size());
  const size_t channel = take(3);
  const size_t x = take(static_cast<size_t>(info.width));
  return absl::InvalidArgumentError(absl::StrCat(
      "view ", view, ", light ", light, ", texel (", x, ", ", static_cast<size_t>(block.row) + index,
      "), channel ", channel, ": sample ", *it, ", expected a finite value up to ", kMaxSample));
}

// Second moments of RGB over all samples, and their legality.
absl::StatusOr<Eigen::Matrix3d> ColourMoments(const BtfInfo& info, RowPasses& passes,
                                              const RunContext& context) {
  const Eigen::Index pairs = static_cast<Eigen::Index>(info.views.size() * info.lights.size());
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  TESSERA_RETURN_IF_ERROR(passes.Run([&](const Block& block) -> absl::Status {
    std::vector<Eigen::Matrix3d> of_rows(block.num_rows, Eigen::Matrix3d::Zero());
    ParallelFor(context, 0, block.num_rows, 1, [&](int64_t begin, int64_t end) {
      for (int64_t row = begin; row < end; ++row) {
        for (int64_t x = 0; x < info.width; ++x) {
          const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 3>> rgb(
              block.samples.data() + (row * info.width + x) * 3 * pairs, pairs, 3);
          for (int i = 0; i < 3; ++i) {
            for (int j = 0; j <= i; ++j) {
              of_rows[row](i, j) += static_cast<double>(rgb.col(i).dot(rgb.col(j)));
            }
          }
        }
      }
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    for (const Eigen::Matrix3d& row : of_rows) {
      // One look at the sums clears almost every row; NaN fails every comparison.
      if (!(row.trace() <= static_cast<double>(kMaxSample) * kMaxSample)) {
        TESSERA_RETURN_IF_ERROR(CheckSamples(info, block));
      }
      moments += row;
    }
    return absl::OkStatus();
  }));
  return Eigen::Matrix3d(moments.selfadjointView<Eigen::Lower>());
}

// Principal axes of the moments as columns, in falling order, signed so that the sum of each is >= 0; float,
// as they are stored. The identity when all samples are black.
Eigen::Matrix3f ColourAxes(const Eigen::Matrix3d& moments) {
  if (moments.trace() <= 0.0) {
    return Eigen::Matrix3f::Identity();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments / moments.trace());
  Eigen::Matrix3d axes = eigen.eigenvectors().rowwise().reverse();
  for (int j = 0; j < 3; ++j) {
    axes.col(j) *= axes.col(j).sum() < 0.0 ? -1.0 : 1.0;
  }
  return axes.cast<float>();
}

// The matrix of samples a block at a time, in colour axes: luminance [pairs][texels], chrominance [2 pairs].
class SampleMatrix {
 public:
  SampleMatrix(int64_t width, Eigen::Index pairs, const Eigen::Matrix3f& axes, const RunContext& context)
      : width_(width), pairs_(pairs), axes_(axes), context_(context) {}

  // Turns the block's samples into colour axes, in place.
  void Rotate(const Block& block) const {
    constexpr int64_t kTexelsPerTask = 8;
    ParallelFor(context_, 0, block.num_texels, kTexelsPerTask, [&](int64_t begin, int64_t end) {
      for (int64_t texel = begin; texel < end; ++texel) {
        float* const x = block.samples.data() + texel * 3 * pairs_;
        for (Eigen::Index i = 0; i < pairs_; ++i) {
          const float r = x[i];
          const float g = x[i + pairs_];
          const float b = x[i + 2 * pairs_];
          for (int j = 0; j < 3; ++j) {
            x[i + j * pairs_] = axes_(0, j) * r + axes_(1, j) * g + axes_(2, j) * b;
          }
        }
      }
    });
  }
  [[nodiscard]] StridedMap Luma(const Block& block) const {
    return {block.samples.data(), pairs_, block.num_texels, Eigen::OuterStride<>(3 * pairs_)};
  }
  [[nodiscard]] StridedMap Chroma(const Block& block) const {
    return {block.samples.data() + pairs_, 2 * pairs_, block.num_texels, Eigen::OuterStride<>(3 * pairs_)};
  }

  // v^T a, [columns of v][texels]. Products are cut at rows of texels, so that neither the budget nor threads
  // change a sum.
  [[nodiscard]] Eigen::MatrixXf Project(const StridedMap& a, const Eigen::MatrixXf& v) const {
    Eigen::MatrixXf t(v.cols(), a.cols());
    constexpr int64_t kTexelsPerTask = 64;
    const int64_t per_row = (width_ + kTexelsPerTask - 1) / kTexelsPerTask;
    ParallelFor(context_, 0, a.cols() / width_ * per_row, 1, [&](int64_t task, int64_t /*end*/) {
      const int64_t x = task % per_row * kTexelsPerTask;
      const int64_t begin = task / per_row * width_ + x;
      const int64_t count = std::min(kTexelsPerTask, width_ - x);
      t.middleCols(begin, count).noalias() = v.transpose() * a.middleCols(begin, count);
    });
    return t;
  }
  // product += a (v^T a)^T. Each task sums its own rows of the product, texels in their order.
  void AddGramProduct(const StridedMap& a, const Eigen::MatrixXf& v, Eigen::MatrixXf& product) const {
    const Eigen::MatrixXf t = Project(a, v);
    constexpr int64_t kPairsPerTask = 512;
    constexpr int64_t kTexelsPerSum = 256;
    ParallelFor(context_, 0, a.rows(), kPairsPerTask, [&](int64_t begin, int64_t end) {
      for (int64_t row = 0; row < a.cols(); row += width_) {
        for (int64_t x = 0; x < width_; x += kTexelsPerSum) {
          const int64_t count = std::min(kTexelsPerSum, width_ - x);
          product.middleRows(begin, end - begin).noalias() +=
              a.block(begin, row + x, end - begin, count) * t.middleCols(row + x, count).transpose();
        }
      }
    });
  }

 private:
  int64_t width_;  // texels of a row
  Eigen::Index pairs_;
  Eigen::Matrix3f axes_;
  const RunContext& context_;
};

struct Spaces {
  SingularSpace luma;
  SingularSpace chroma;
};

absl::StatusOr<Spaces> FindSpaces(const SampleMatrix& matrix, Eigen::Index pairs, int luma_rank,
                                  int chroma_rank, RowPasses& passes) {
  BlockLanczos luma(pairs, luma_rank, kSeed);
  BlockLanczos chroma(2 * pairs, chroma_rank, kSeed);
  for (int pass = 0; pass < kLanczosPasses && !(luma.is_complete() && chroma.is_complete()); ++pass) {
    Eigen::MatrixXf luma_product = Eigen::MatrixXf::Zero(pairs, luma.block().cols());
    Eigen::MatrixXf chroma_product = Eigen::MatrixXf::Zero(2 * pairs, chroma.block().cols());
    TESSERA_RETURN_IF_ERROR(passes.Run([&](const Block& block) {
      matrix.Rotate(block);
      if (!luma.is_complete()) {
        matrix.AddGramProduct(matrix.Luma(block), luma.block(), luma_product);
      }
      if (!chroma.is_complete()) {
        matrix.AddGramProduct(matrix.Chroma(block), chroma.block(), chroma_product);
      }
      return absl::OkStatus();
    }));
    if (!luma.is_complete()) {
      luma.Add(luma_product);
    }
    if (!chroma.is_complete()) {
      chroma.Add(chroma_product);
    }
  }
  return Spaces{luma.Leading(luma_rank), chroma.Leading(chroma_rank)};
}

struct Ranges {
  std::vector<float> minima;
  std::vector<float> maxima;
};

// Coefficients of all candidate components, [texel][k], into `store`; their ranges.
absl::StatusOr<Ranges> ProjectTexels(const SampleMatrix& matrix, const Spaces& spaces,
                                     CoefficientStore& store, int width, RowPasses& passes) {
  const Eigen::MatrixXf luma = spaces.luma.vectors.cast<float>();
  const Eigen::MatrixXf chroma = spaces.chroma.vectors.cast<float>();
  const Eigen::Index k = luma.cols() + chroma.cols();
  Eigen::ArrayXf minima = Eigen::ArrayXf::Constant(k, std::numeric_limits<float>::infinity());
  Eigen::ArrayXf maxima = -minima;
  TESSERA_RETURN_IF_ERROR(passes.Run([&](const Block& block) -> absl::Status {
    matrix.Rotate(block);
    const std::span<float> values =
        store.BeginWrite(static_cast<uint64_t>(block.row) * width * k, block.num_texels * k);
    Eigen::Map<Eigen::MatrixXf> t(values.data(), k, block.num_texels);
    t.topRows(luma.cols()) = matrix.Project(matrix.Luma(block), luma);
    t.bottomRows(chroma.cols()) = matrix.Project(matrix.Chroma(block), chroma);
    minima = minima.min(t.rowwise().minCoeff().array());
    maxima = maxima.max(t.rowwise().maxCoeff().array());
    return store.EndWrite();
  }));
  return Ranges{{minima.begin(), minima.end()}, {maxima.begin(), maxima.end()}};
}

// Seven nodes for two measured directions: on wool with every fifth direction held out, more of them gain
// less than a hundredth.
int NodesPerSide(size_t num_directions) {
  int n = 5;
  while (n < 25 && static_cast<size_t>(2 * n) * n < 7 * num_directions) {
    n += 2;
  }
  return n;
}

// A trend of a quarter as many functions as directions at most, and a covariance that reaches about two
// directions far. Both, and the nugget, were chosen on wool: longer ranges and larger nuggets bring held-out
// directions down by up to 4% of their error, and take measured ones up by 20%.
ResampleRule RuleFor(const std::vector<Direction>& directions) {
  const double count = static_cast<double>(directions.size());
  ResampleRule rule;
  rule.trend = count >= 64 ? 16 : count >= 36 ? 9 : count >= 16 ? 4 : 1;
  rule.range = std::clamp(4.5 / std::sqrt(count), 0.1, 2.0);
  return rule;
}

double MaxTheta(const std::vector<Direction>& directions) {
  double theta = 0.0;
  for (const Direction& d : directions) {
    theta = std::max(theta, std::min(d.theta_rad, kPi / 2.0));
  }
  return theta;
}

// What decodes at the measured directions from unit values there, [directions][directions].
Eigen::MatrixXd Smoothing(const std::vector<Direction>& directions) {
  const DirectionGrid grid(MaxTheta(directions), NodesPerSide(directions.size()));
  const Eigen::MatrixXd resample = ResampleMatrix(grid, directions, RuleFor(directions));
  Eigen::MatrixXd smoothing(resample.cols(), resample.cols());
  for (Eigen::Index i = 0; i < smoothing.rows(); ++i) {
    const DirectionGrid::Stencil at = grid.Find(VectorFromDirection(directions[i]));
    smoothing.row(i) = at.weights[0] * resample.row(at.nodes[0]) + at.weights[1] * resample.row(at.nodes[1]) +
                       at.weights[2] * resample.row(at.nodes[2]);
  }
  return smoothing;
}

// Factors of the first `rank` vectors as they are stored, for each part of [views * lights] rows by itself.
std::vector<AngularCodes> StoredParts(const SingularSpace& space, Eigen::Index pairs, Eigen::Index rank,
                                      DType dtype) {
  std::vector<AngularCodes> parts;
  for (Eigen::Index begin = 0; begin < space.vectors.rows(); begin += pairs) {
    parts.push_back(QuantizeFactors(space.vectors.block(begin, 0, pairs, rank), dtype));
  }
  return parts;
}

struct Smoothings {
  Eigen::MatrixXd light;
  Eigen::MatrixXd view;
};

// Components below this share of all energy are rounding of the float products that found them.
constexpr double kRoundingEnergy = 1e-7;

// The gain and cost of every candidate of one list, whose first column in `ranges` is `first`.
std::vector<ComponentCost> Costs(const SingularSpace& space, const Smoothings& smoothings, DType dtype,
                                 const Ranges& ranges, Eigen::Index first, uint64_t num_texels,
                                 double all_energy) {
  const Eigen::Index pairs = smoothings.light.rows() * smoothings.view.rows();
  const Eigen::Index rank = space.values.size();
  if (rank == 0) {
    return {};
  }
  const std::vector<AngularCodes> parts = StoredParts(space, pairs, rank, dtype);
  Eigen::MatrixXd stored(space.vectors.rows(), rank);
  for (size_t part = 0; part < parts.size(); ++part) {
    stored.middleRows(static_cast<Eigen::Index>(part) * pairs, pairs) = DequantizeFactors(parts[part]);
  }
  const Eigen::VectorXd errors = FactorErrors(space.vectors, stored, smoothings.light, smoothings.view);
  // A code a texel and a pair; offset and step of the coefficient and of each part's factor.
  const uint64_t code_bytes = dtype == DType::kU8 ? 1 : 2;
  const uint64_t bytes =
      num_texels + static_cast<uint64_t>(space.vectors.rows()) * code_bytes + 8 * (1 + parts.size());
  std::vector<ComponentCost> costs;
  for (Eigen::Index k = 0; k < rank; ++k) {
    const double energy = space.values[k] * space.values[k];
    const double step = static_cast<double>(ranges.maxima[first + k] - ranges.minima[first + k]) / 255.0;
    // Uniform rounding errors; the factors have unit norm.
    const double rounding = static_cast<double>(num_texels) * step * step / 12.0;
    const bool is_real = energy > kRoundingEnergy * all_energy;
    costs.push_back({is_real ? energy * (1.0 - errors[k]) - rounding : 0.0, bytes});
  }
  return costs;
}

// What the parameters ask for, and how many candidates are worth seeking at first.
struct Goal {
  RankBudget budget;
  int luma_candidates = 0;
  int chroma_candidates = 0;
  int most_luma = 0;  // that there can be
  int most_chroma = 0;
};

// Bytes of the container that no component adds to.
uint64_t FixedBytes(const BtfInfo& info) {
  return kHeaderBytes + info.provenance.source.size() + info.provenance.licence.size() +
         info.provenance.citation.size() + info.radiometry.size() +
         12 * (info.views.size() + info.lights.size()) + 36;
}

Goal GoalOf(const EncodeParams& params, const BtfInfo& info, double num_samples) {
  constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max() / 2;
  Goal goal{.budget = {.max_rank = 2 * kMaxDfmfRank, .max_bytes = kNoLimit}};
  constexpr int kFirstCandidates = 64;
  int candidates = kFirstCandidates;
  if (params.max_bytes > 0) {
    goal.budget.max_bytes = params.max_bytes;
    const uint64_t per_component =
        static_cast<uint64_t>(info.width) * info.height + info.views.size() * info.lights.size();
    candidates = static_cast<int>(std::min<uint64_t>(params.max_bytes / per_component + 1, kMaxDfmfRank));
  } else if (params.max_error > 0.0) {
    goal.budget.squared_error = params.max_error * params.max_error * num_samples;
  } else {
    goal.budget.max_rank = params.rank > 0 ? params.rank : kDefaultDfmfRank;
    candidates = goal.budget.max_rank;
  }
  const uint64_t num_texels = static_cast<uint64_t>(info.width) * info.height;
  const uint64_t pairs = info.views.size() * info.lights.size();
  const auto most = [&](uint64_t rows) {
    return static_cast<int>(std::min({static_cast<uint64_t>(kMaxDfmfRank), num_texels, rows}));
  };
  goal.most_luma = most(pairs);
  goal.most_chroma = most(2 * pairs);
  goal.luma_candidates = std::min(candidates, goal.most_luma);
  // Colours vary less than brightness wherever both are at hand.
  goal.chroma_candidates = std::min((candidates + 1) / 2, goal.most_chroma);
  return goal;
}

struct Choice {
  DType dtype = DType::kU8;
  Ranks ranks;
};

// Ranks with 8-bit factors, or with 16-bit ones where they do better: fewer bytes for the error, less error
// for the bytes, or, at a given rank, an error lower by more than a hundredth.
Choice Choose(const Spaces& spaces, const Smoothings& smoothings, const Ranges& ranges, double energy,
              const BtfInfo& info, const EncodeParams& params, const RankBudget& budget) {
  const uint64_t num_texels = static_cast<uint64_t>(info.width) * info.height;
  const auto ranks_with = [&](DType dtype) {
    return ChooseRanks(
        Costs(spaces.luma, smoothings, dtype, ranges, 0, num_texels, energy),
        Costs(spaces.chroma, smoothings, dtype, ranges, spaces.luma.values.size(), num_texels, energy),
        energy, FixedBytes(info), budget);
  };
  const Ranks narrow = ranks_with(DType::kU8);
  const Ranks wide = ranks_with(DType::kU16);
  bool take_wide = false;
  if (params.max_error > 0.0) {
    const bool narrow_meets = narrow.squared_error <= budget.squared_error;
    const bool wide_meets = wide.squared_error <= budget.squared_error;
    take_wide = wide_meets && (!narrow_meets || wide.bytes < narrow.bytes);
  } else {
    constexpr double kWorthIt = 0.99 * 0.99;
    take_wide = wide.bytes <= budget.max_bytes &&
                wide.squared_error < (params.max_bytes > 0 ? 1.0 : kWorthIt) * narrow.squared_error;
  }
  return take_wide ? Choice{DType::kU16, wide} : Choice{DType::kU8, narrow};
}

void AddTables(const Spaces& spaces, const Choice& choice, int64_t num_views, int64_t num_lights,
               BtfelTable& table) {
  const Eigen::Index pairs = num_views * num_lights;
  std::vector<AngularCodes> luma = StoredParts(spaces.luma, pairs, choice.ranks.luma, choice.dtype);
  luma[0].codes.shape = {num_views, num_lights, choice.ranks.luma};
  table.tables[kDfmfLuma] = std::move(luma[0].codes);
  table.tables[kDfmfLumaOffset] = std::move(luma[0].offset);
  table.tables[kDfmfLumaStep] = std::move(luma[0].step);
  const int64_t q = choice.ranks.chroma;
  if (q == 0) {
    return;
  }
  CodecTable codes{{2, num_views, num_lights, q}, {}, choice.dtype};
  CodecTable offset{{2, q}, {}};
  CodecTable step{{2, q}, {}};
  for (const AngularCodes& part : StoredParts(spaces.chroma, pairs, q, choice.dtype)) {
    codes.values.insert(codes.values.end(), part.codes.values.begin(), part.codes.values.end());
    offset.values.insert(offset.values.end(), part.offset.values.begin(), part.offset.values.end());
    step.values.insert(step.values.end(), part.step.values.begin(), part.step.values.end());
  }
  table.tables[kDfmfChroma] = std::move(codes);
  table.tables[kDfmfChromaOffset] = std::move(offset);
  table.tables[kDfmfChromaStep] = std::move(step);
}

// The chosen coefficients of every texel, quantised into table.codes.
absl::Status QuantizeTexels(CoefficientStore& store, const Ranges& ranges, Eigen::Index luma_candidates,
                            const Ranks& ranks, uint64_t num_texels, const EncodeParams& params,
                            BtfelTable& table, const RunContext& context) {
  const size_t candidates = ranges.minima.size();
  std::vector<size_t> columns;
  for (int i = 0; i < ranks.luma; ++i) {
    columns.push_back(i);
  }
  for (int i = 0; i < ranks.chroma; ++i) {
    columns.push_back(luma_candidates + i);
  }
  std::vector<float> minima;
  std::vector<float> maxima;
  for (const size_t column : columns) {
    minima.push_back(ranges.minima[column]);
    maxima.push_back(ranges.maxima[column]);
  }
  Quantisation quantisation = UniformQuantisation(minima, maxima);
  const size_t k = columns.size();
  table.num_coefficients = static_cast<int>(k);
  TESSERA_ASSIGN_OR_RETURN(table.codes, CreateCodes(num_texels * k, params));
  constexpr uint64_t kTexelsPerBlock = 1 << 14;
  for (uint64_t begin = 0; begin < num_texels; begin += kTexelsPerBlock) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const uint64_t count = std::min(kTexelsPerBlock, num_texels - begin);
    TESSERA_ASSIGN_OR_RETURN(const std::span<const float> values,
                             store.Read(begin * candidates, count * candidates));
    constexpr int64_t kTexelsPerTask = 512;
    ParallelFor(context, 0, static_cast<int64_t>(count), kTexelsPerTask, [&](int64_t first, int64_t last) {
      std::vector<float> chosen(k);
      for (int64_t texel = first; texel < last; ++texel) {
        for (size_t i = 0; i < k; ++i) {
          chosen[i] = values[texel * candidates + columns[i]];
        }
        Quantize(quantisation, chosen, std::span(table.codes).subspan((begin + texel) * k, k));
      }
    });
    table.codes.DropPages();
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  table.offset = std::move(quantisation.offset);
  table.step = std::move(quantisation.step);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Material> EncodeDfmf(BtfSource& source, const EncodeParams& params,
                                    const RunContext& context) {
  const BtfInfo& info = source.info();
  TESSERA_RETURN_IF_ERROR(CheckInput(info, params));
  const int64_t num_views = static_cast<int64_t>(info.views.size());
  const int64_t num_lights = static_cast<int64_t>(info.lights.size());
  const Eigen::Index pairs = num_views * num_lights;
  const uint64_t num_texels = static_cast<uint64_t>(info.width) * info.height;
  const double num_samples = 3.0 * static_cast<double>(num_texels) * static_cast<double>(pairs);

  // A quarter of the budget for samples, half for coefficients, the last quarter for codes.
  RowPasses passes(source, params.memory_budget_bytes / 4, 1 + kLanczosPasses + 1, context);
  TESSERA_ASSIGN_OR_RETURN(const Eigen::Matrix3d moments, ColourMoments(info, passes, context));
  const Eigen::Matrix3f axes = ColourAxes(moments);
  const SampleMatrix matrix(info.width, pairs, axes, context);
  const ResampleRule light_rule = RuleFor(info.lights);
  const ResampleRule view_rule = RuleFor(info.views);
  const Smoothings smoothings{Smoothing(info.lights), Smoothing(info.views)};

  Goal goal = GoalOf(params, info, num_samples);
  while (true) {
    TESSERA_ASSIGN_OR_RETURN(const Spaces spaces,
                             FindSpaces(matrix, pairs, goal.luma_candidates, goal.chroma_candidates, passes));
    const Eigen::Index candidates = spaces.luma.values.size() + spaces.chroma.values.size();
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<CoefficientStore> store,
                             CoefficientStore::Create(num_texels * candidates, params.memory_budget_bytes / 2,
                                                      params.spill_folder));
    TESSERA_ASSIGN_OR_RETURN(const Ranges ranges, ProjectTexels(matrix, spaces, *store, info.width, passes));
    const Choice choice = Choose(spaces, smoothings, ranges, moments.trace(), info, params, goal.budget);
    const double rmse = std::sqrt(std::max(0.0, choice.ranks.squared_error) / num_samples);
    if (params.max_error > 0.0 && choice.ranks.squared_error > goal.budget.squared_error) {
      if (goal.luma_candidates < goal.most_luma || goal.chroma_candidates < goal.most_chroma) {
        goal.luma_candidates = std::min(2 * goal.luma_candidates, goal.most_luma);
        goal.chroma_candidates = std::min(2 * goal.chroma_candidates, goal.most_chroma);
        passes.ExpectMore(kLanczosPasses + 1);
        continue;
      }
      return absl::FailedPreconditionError(absl::StrCat("max_error = ", params.max_error, ": ",
                                                        choice.ranks.luma, " + ", choice.ranks.chroma,
                                                        " components leave an RMSE of ", rmse));
    }
    if (choice.ranks.bytes > goal.budget.max_bytes) {
      return absl::FailedPreconditionError(absl::StrCat(
          "max_bytes = ", params.max_bytes, ": one component takes ", choice.ranks.bytes, " bytes"));
    }
    passes.Finish();

    Material material;
    material.width = info.width;
    material.height = info.height;
    material.provenance = info.provenance;
    material.radiometry = info.radiometry;
    material.metadata["encode_rmse"] = rmse;
    BtfelTable& table = material.btfels;
    table.codec_id = "dfmf";
    table.codec_version = kDfmfVersion;
    table.parameters = {{"light_nodes", NodesPerSide(info.lights.size())},
                        {"view_nodes", NodesPerSide(info.views.size())},
                        {"light_trend", light_rule.trend},
                        {"view_trend", view_rule.trend},
                        {"light_range", light_rule.range},
                        {"view_range", view_rule.range},
                        {"ridge", light_rule.ridge},
                        {"nugget", light_rule.nugget}};
    table.views = info.views;
    table.lights = info.lights;
    CodecTable colour{{3, 3}, {}};
    for (int channel = 0; channel < 3; ++channel) {
      for (int j = 0; j < 3; ++j) {
        colour.values.push_back(axes(channel, j));
      }
    }
    table.tables[kDfmfColour] = std::move(colour);
    AddTables(spaces, choice, num_views, num_lights, table);
    TESSERA_RETURN_IF_ERROR(QuantizeTexels(*store, ranges, spaces.luma.values.size(), choice.ranks,
                                           num_texels, params, table, context));
    return material;
  }
}

}  // namespace tessera
