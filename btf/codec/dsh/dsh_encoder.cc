#include "btf/codec/dsh/dsh_encoder.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/dsh/coefficient_store.h"
#include "btf/codec/quantize.h"
#include "btf/math/constrained_least_squares.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

using Solver = ClsSolver<float>;
using MatrixMap = Eigen::Map<const Eigen::MatrixXf>;

// Signals fitted together, about: few enough for the products' operands to stay in the second-level cache
// (and Eigen's copies of them on the stack), enough to fill vectors where there are few views. Sums are
// formed within a signal only, and groups are cut the same way for any budget and number of threads.
constexpr int64_t kSignalsPerGroup = 256;
constexpr int64_t kSamplesPerTask = 1 << 18;
// More rows at once gain nothing.
constexpr uint64_t kMaxRowBlockBytes = uint64_t{64} << 20;

Eigen::Index PadToLanes(Eigen::Index rows) {
  return (rows + Solver::kLanes - 1) / Solver::kLanes * Solver::kLanes;
}

// sum f^2 in a fixed order whatever the address, which decides how a library would cut the sum.
float SumOfSquares(const float* f, Eigen::Index count) {
  using Lanes = Eigen::Array<float, 8, 1>;
  constexpr Eigen::Index kWidth = Lanes::SizeAtCompileTime;
  Lanes even = Lanes::Zero();  // two sums, so that one addition need not wait for the other
  Lanes odd = Lanes::Zero();
  Eigen::Index i = 0;
  for (; i + 2 * kWidth <= count; i += 2 * kWidth) {
    even += Eigen::Map<const Lanes>(f + i).square();
    odd += Eigen::Map<const Lanes>(f + i + kWidth).square();
  }
  float rest = 0.0F;
  for (; i < count; ++i) {
    rest += f[i] * f[i];
  }
  even += odd;
  return rest + even.sum();
}

bool IsLegalSample(float f) {
  return std::abs(f) <= kMaxSample;
}

double SolidAngle(ClsEnergy energy) {
  return energy == ClsEnergy::kHemisphere ? 2.0 * kPi : 4.0 * kPi;
}

Eigen::MatrixXd BasisOf(const std::vector<Direction>& directions, int num_functions) {
  Eigen::Matrix3Xd vectors(3, directions.size());
  for (size_t i = 0; i < directions.size(); ++i) {
    vectors.col(static_cast<Eigen::Index>(i)) = VectorFromDirection(directions[i]);
  }
  return ShMatrix(num_functions, vectors);
}

// Intermediate results of one group of texels.
struct Scratch {
  Eigen::MatrixXf projected;  // [signals, padded][kl], then [kv]
  Eigen::VectorXf energies;
  Eigen::MatrixXf view_samples;  // [views][(texel, channel, i)]
  Eigen::MatrixXf coefficients;  // [(texel, channel, i)][kv]
};

// Scratch that outlives its task: returned to the system after each, its pages would be faulted in again.
class ScratchPool {
 public:
  std::unique_ptr<Scratch> Take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) {
      return std::make_unique<Scratch>();
    }
    std::unique_ptr<Scratch> scratch = std::move(free_.back());
    free_.pop_back();
    return scratch;
  }
  void Return(std::unique_ptr<Scratch> scratch) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(scratch));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<Scratch>> free_;  // guarded by mutex_
};

// Both passes for groups of texels. Immutable; each task brings its own scratch.
class GroupFitter {
 public:
  GroupFitter(const BtfInfo& info, const EncodeParams& params)
      : num_lights_(static_cast<Eigen::Index>(info.lights.size())),
        num_views_(static_cast<Eigen::Index>(info.views.size())),
        kl_(params.kl),
        kv_(params.kv),
        light_energy_scale_(
            static_cast<float>(SolidAngle(params.cls_energy) / static_cast<double>(num_lights_))),
        view_energy_scale_(
            static_cast<float>(SolidAngle(params.cls_energy) / static_cast<double>(num_views_))),
        light_solver_(BasisOf(info.lights, params.kl)),
        view_solver_(BasisOf(info.views, params.kv)) {}

  [[nodiscard]] int64_t TexelsPerGroup() const {
    return std::max<int64_t>(1, kSignalsPerGroup / (3 * std::max<int64_t>(num_views_, kl_)));
  }
  [[nodiscard]] size_t SamplesPerTexel() const { return static_cast<size_t>(3 * num_views_ * num_lights_); }
  [[nodiscard]] size_t CoefficientsPerTexel() const { return static_cast<size_t>(3) * kl_ * kv_; }

  // samples [texel][channel][view][light] -> coefficients [texel][(channel * kv + j) * kl + i]. False when a
  // sample is not finite or beyond kMaxSample; the coefficients are then undefined.
  bool Fit(const float* samples, int num_texels, float* coefficients, Scratch& scratch) const {
    const Eigen::Index num_blocks = Eigen::Index{3} * num_texels;  // (texel, channel)
    const Eigen::Index num_signals = num_blocks * num_views_;
    if (!FitLights(samples, num_signals, scratch)) {
      return false;
    }
    // Back to harmonics, and at once with the views running fastest, as the second pass wants them.
    scratch.view_samples.resize(num_views_, num_blocks * kl_);
    for (Eigen::Index block = 0; block < num_blocks; ++block) {
      scratch.view_samples.middleCols(block * kl_, kl_).noalias() =
          scratch.projected.middleRows(block * num_views_, num_views_) *
          light_solver_.eigenvectors().transpose();
    }
    FitViews(num_blocks * kl_, scratch);
    for (Eigen::Index block = 0; block < num_blocks; ++block) {
      for (Eigen::Index j = 0; j < kv_; ++j) {
        std::copy_n(scratch.coefficients.col(j).data() + block * kl_, kl_, coefficients);
        coefficients += kl_;
      }
    }
    return true;
  }

 private:
  bool FitLights(const float* samples, Eigen::Index num_signals, Scratch& scratch) const {
    const Eigen::Index padded = PadToLanes(num_signals);
    scratch.energies.resize(padded);
    for (Eigen::Index s = 0; s < num_signals; ++s) {
      const float* const f = samples + s * num_lights_;
      const float sum = SumOfSquares(f, num_lights_);
      // One look at the sum clears almost every signal; NaN fails every comparison.
      if (!(sum <= kMaxSample * kMaxSample) && !std::all_of(f, f + num_lights_, IsLegalSample)) {
        return false;
      }
      scratch.energies[s] = light_energy_scale_ * sum;
    }
    scratch.energies.tail(padded - num_signals).setZero();
    scratch.projected.resize(padded, kl_);
    scratch.projected.topRows(num_signals).noalias() =
        MatrixMap(samples, num_lights_, num_signals).transpose() * light_solver_.projection().transpose();
    scratch.projected.bottomRows(padded - num_signals).setZero();
    light_solver_.Shrink(scratch.energies, scratch.projected);
    return true;
  }

  void FitViews(Eigen::Index num_signals, Scratch& scratch) const {
    const Eigen::Index padded = PadToLanes(num_signals);
    scratch.energies.resize(padded);
    for (Eigen::Index s = 0; s < num_signals; ++s) {
      scratch.energies[s] = view_energy_scale_ * SumOfSquares(scratch.view_samples.col(s).data(), num_views_);
    }
    scratch.energies.tail(padded - num_signals).setZero();
    scratch.projected.resize(padded, kv_);
    scratch.projected.topRows(num_signals).noalias() =
        scratch.view_samples.transpose() * view_solver_.projection().transpose();
    scratch.projected.bottomRows(padded - num_signals).setZero();
    view_solver_.Shrink(scratch.energies, scratch.projected);
    scratch.coefficients.resize(num_signals, kv_);
    scratch.coefficients.noalias() =
        scratch.projected.topRows(num_signals) * view_solver_.eigenvectors().transpose();
  }

  Eigen::Index num_lights_;
  Eigen::Index num_views_;
  Eigen::Index kl_;
  Eigen::Index kv_;
  float light_energy_scale_;
  float view_energy_scale_;
  Solver light_solver_;
  Solver view_solver_;
};

absl::Status CheckDirections(const std::vector<Direction>& directions, const char* name) {
  if (directions.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("the BTF has no ", name));
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
  for (const auto& [name, value] : {std::pair("kl", params.kl), std::pair("kv", params.kv)}) {
    if (!IsShFunctionCount(value)) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " = ", value, ": legal values are 1, 4, 9, 16, 25, 36 and 49"));
    }
  }
  if (info.width < 1 || info.height < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("the BTF is ", info.width, "x", info.height, " texels, expected at least 1x1"));
  }
  TESSERA_RETURN_IF_ERROR(CheckDirections(info.views, "views"));
  return CheckDirections(info.lights, "lights");
}

// Names the first illegal sample of a block of rows.
absl::Status IllegalSampleError(const BtfInfo& info, int row_begin, std::span<const float> samples) {
  const auto it = std::ranges::find_if_not(samples, IsLegalSample);
  if (it == samples.end()) {
    return absl::InternalError("samples were refused, but none is illegal");
  }
  size_t index = static_cast<size_t>(it - samples.begin());
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
      "view ", view, ", light ", light, ", texel (", x, ", ", static_cast<size_t>(row_begin) + index,
      "), channel ", channel, ": sample ", *it, ", expected a finite value up to ", kMaxSample));
}

struct Ranges {
  std::vector<float> minima;
  std::vector<float> maxima;

  explicit Ranges(size_t k)
      : minima(k, std::numeric_limits<float>::infinity()),
        maxima(k, -std::numeric_limits<float>::infinity()) {}

  void Include(std::span<const float> low, std::span<const float> high) {
    for (size_t i = 0; i < minima.size(); ++i) {
      minima[i] = std::min(minima[i], low[i]);
      maxima[i] = std::max(maxima[i], high[i]);
    }
  }
};

// Fits rows of samples into `coefficients` [row][x][k] and widens `ranges`. False on an illegal sample.
bool FitRows(const GroupFitter& fitter, int width, int num_rows, std::span<const float> samples,
             std::span<float> coefficients, Ranges& ranges, ScratchPool& pool, const RunContext& context) {
  const size_t k = fitter.CoefficientsPerTexel();
  const int64_t texels_per_group = fitter.TexelsPerGroup();
  const int64_t groups_per_row = (width + texels_per_group - 1) / texels_per_group;
  const int64_t groups_per_task = std::max<int64_t>(
      1, kSamplesPerTask / (texels_per_group * static_cast<int64_t>(fitter.SamplesPerTexel())));
  std::atomic<bool> is_legal = true;
  std::mutex mutex;  // guards `ranges`
  ParallelFor(context, 0, groups_per_row * num_rows, groups_per_task, [&](int64_t begin, int64_t end) {
    std::unique_ptr<Scratch> scratch = pool.Take();
    Ranges local(k);
    for (int64_t group = begin; group < end; ++group) {
      const int64_t x = group % groups_per_row * texels_per_group;
      const size_t texel = static_cast<size_t>(group / groups_per_row * width + x);
      const int num_texels = static_cast<int>(std::min<int64_t>(texels_per_group, width - x));
      float* const out = coefficients.data() + texel * k;
      if (!fitter.Fit(samples.data() + texel * fitter.SamplesPerTexel(), num_texels, out, *scratch)) {
        is_legal = false;
        return;
      }
      for (int t = 0; t < num_texels; ++t) {
        const std::span<const float> one(out + t * k, k);
        local.Include(one, one);
      }
    }
    pool.Return(std::move(scratch));
    const std::lock_guard lock(mutex);
    ranges.Include(local.minima, local.maxima);
  });
  return is_legal;
}

CodecTable Identity(int n) {
  CodecTable table{{n, n}, std::vector<float>(static_cast<size_t>(n) * n, 0.0F)};
  for (int i = 0; i < n; ++i) {
    table.values[static_cast<size_t>(i) * n + i] = 1.0F;
  }
  return table;
}

// How many rows fit, at least 1.
int RowsWithin(uint64_t bytes, uint64_t bytes_per_row, int height) {
  return static_cast<int>(std::clamp<uint64_t>(bytes / bytes_per_row, 1, static_cast<uint64_t>(height)));
}

}  // namespace

absl::StatusOr<Material> EncodeDshCls(BtfSource& source, const EncodeParams& params,
                                      const RunContext& context) {
  const BtfInfo& info = source.info();
  TESSERA_RETURN_IF_ERROR(CheckInput(info, params));
  const GroupFitter fitter(info, params);
  const size_t k = fitter.CoefficientsPerTexel();
  const size_t values_per_row = static_cast<size_t>(info.width) * k;
  const uint64_t sample_row_bytes = source.SamplesPerRow() * sizeof(float);
  const uint64_t coefficient_row_bytes = values_per_row * sizeof(float);

  // Three quarters of the budget for coefficients; what they leave is for rows of samples.
  const uint64_t coefficient_budget = params.memory_budget_bytes / 4 * 3;
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<CoefficientStore> store,
                           CoefficientStore::Create(values_per_row * info.height, coefficient_budget));
  const uint64_t block_bytes =
      store->is_spilled() ? sample_row_bytes + coefficient_row_bytes : sample_row_bytes;
  const uint64_t held_bytes = store->is_spilled() ? 0 : coefficient_row_bytes * info.height;
  const int rows_per_block = RowsWithin(std::min(params.memory_budget_bytes - held_bytes, kMaxRowBlockBytes),
                                        block_bytes, info.height);

  // One stage for the caller: the source's own rows are not told apart from their encoding.
  RunContext source_context = context;
  source_context.progress = nullptr;

  Ranges ranges(k);
  ScratchPool pool;
  // Not zeroed, the source fills it.
  auto sample_buffer = std::make_unique_for_overwrite<float[]>(source.SamplesPerRow() * rows_per_block);
  for (int row = 0; row < info.height; row += rows_per_block) {
    context.Report("encode", row, info.height, "rows");
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const int num_rows = std::min(rows_per_block, info.height - row);
    const std::span<float> samples(sample_buffer.get(), source.SamplesPerRow() * num_rows);
    TESSERA_RETURN_IF_ERROR(source.ReadRows(row, num_rows, samples, source_context));
    const std::span<float> block = store->BeginWrite(values_per_row * row, values_per_row * num_rows);
    const bool is_legal = FitRows(fitter, info.width, num_rows, samples, block, ranges, pool, context);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (!is_legal) {
      return IllegalSampleError(info, row, samples);
    }
    TESSERA_RETURN_IF_ERROR(store->EndWrite());
  }
  sample_buffer.reset();
  context.Report("encode", info.height, info.height, "rows");

  Material material;
  material.width = info.width;
  material.height = info.height;
  material.provenance = info.provenance;
  material.radiometry = info.radiometry;
  BtfelTable& table = material.btfels;
  table.codec_id = "dsh-cls";
  table.codec_version = 1;
  table.num_coefficients = static_cast<int>(k);
  table.tables = {{"basis_light", Identity(params.kl)}, {"basis_view", Identity(params.kv)}};
  table.parameters = {{"kl", params.kl},
                      {"kv", params.kv},
                      {"cls_energy", params.cls_energy == ClsEnergy::kHemisphere ? "hemisphere" : "sphere"}};
  table.views = info.views;
  table.lights = info.lights;
  Quantisation quantisation = UniformQuantisation(ranges.minima, ranges.maxima);
  TESSERA_ASSIGN_OR_RETURN(table.codes, CreateCodes(values_per_row * info.height, params));
  for (int row = 0; row < info.height; row += rows_per_block) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const size_t begin = values_per_row * row;
    const size_t count = values_per_row * std::min(rows_per_block, info.height - row);
    TESSERA_ASSIGN_OR_RETURN(const std::span<const float> values, store->Read(begin, count));
    constexpr int64_t kTexelsPerTask = 64;
    ParallelFor(context, 0, static_cast<int64_t>(count / k), kTexelsPerTask,
                [&](int64_t first, int64_t last) {
                  const size_t size = static_cast<size_t>(last - first) * k;
                  Quantize(quantisation, values.subspan(first * k, size),
                           std::span(table.codes).subspan(begin + first * k, size));
                });
    table.codes.DropPages();
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  table.offset = std::move(quantisation.offset);
  table.step = std::move(quantisation.step);
  return material;
}

}  // namespace tessera
