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
#include <nlohmann/json.hpp>

#include "btf/base/huge_pages.h"
#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_store.h"
#include "btf/codec/dsh/dsh_basis.h"
#include "btf/codec/dsh/dsh_fitter.h"
#include "btf/codec/encoder_input.h"
#include "btf/codec/quantize.h"
#include "btf/math/max_theta.h"
#include "btf/math/ridge.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

constexpr int64_t kSamplesPerTask = 1 << 18;
constexpr int64_t kRidgeTexelsPerTask = 4;
// More rows at once gain nothing.
constexpr uint64_t kMaxRowBlockBytes = uint64_t{64} << 20;

// Scratch that outlives its task: returned to the system after each, its pages would be faulted in again.
class ScratchPool {
 public:
  std::unique_ptr<DshScratch> Take() {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) {
      return std::make_unique<DshScratch>();
    }
    std::unique_ptr<DshScratch> scratch = std::move(free_.back());
    free_.pop_back();
    return scratch;
  }
  void Return(std::unique_ptr<DshScratch> scratch) {
    const std::lock_guard lock(mutex_);
    free_.push_back(std::move(scratch));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<DshScratch>> free_;  // guarded by mutex_
};

absl::Status CheckInput(const BtfInfo& info, const EncodeParams& params) {
  for (const auto& [name, value] : {std::pair("kl", params.kl), std::pair("kv", params.kv)}) {
    if (!IsShFunctionCount(value)) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " = ", value, ": legal values are 1, 4, 9, 16, 25, 36 and 49"));
    }
  }
  return CheckEncoderInput(info);
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
bool FitRows(const DshFitter& fitter, int width, int num_rows, std::span<const float> samples,
             std::span<float> coefficients, Ranges& ranges, ScratchPool& pool, const RunContext& context) {
  const size_t k = fitter.CoefficientsPerTexel();
  const int64_t texels_per_group = fitter.TexelsPerGroup();
  const int64_t groups_per_row = (width + texels_per_group - 1) / texels_per_group;
  const int64_t groups_per_task = std::max<int64_t>(
      1, kSamplesPerTask / (texels_per_group * static_cast<int64_t>(fitter.SamplesPerTexel())));
  std::atomic<bool> is_legal = true;
  std::mutex mutex;  // guards `ranges`
  ParallelFor(context, 0, groups_per_row * num_rows, groups_per_task, [&](int64_t begin, int64_t end) {
    std::unique_ptr<DshScratch> scratch = pool.Take();
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

CodecTable TableOf(const Eigen::MatrixXd& basis) {
  CodecTable table{{basis.rows(), basis.cols()}, {}};
  for (Eigen::Index i = 0; i < basis.rows(); ++i) {
    for (Eigen::Index j = 0; j < basis.cols(); ++j) {
      table.values.push_back(static_cast<float>(basis(i, j)));
    }
  }
  return table;
}

// How many rows fit, at least 1.
int RowsWithin(uint64_t bytes, uint64_t bytes_per_row, int height) {
  return static_cast<int>(std::clamp<uint64_t>(bytes / bytes_per_row, 1, static_cast<uint64_t>(height)));
}

// How one codec fits, and what its tables say.
struct Model {
  std::string codec_id;
  std::unique_ptr<DshFitter> fitter;
  Eigen::MatrixXd basis_light;
  Eigen::MatrixXd basis_view;
  nlohmann::json parameters;
};

absl::StatusOr<Material> EncodeWith(const Model& model, BtfSource& source, const EncodeParams& params,
                                    const RunContext& context) {
  const BtfInfo& info = source.info();
  const DshFitter& fitter = *model.fitter;
  const size_t k = fitter.CoefficientsPerTexel();
  const size_t values_per_row = static_cast<size_t>(info.width) * k;
  const uint64_t sample_row_bytes = source.SamplesPerRow() * sizeof(float);
  const uint64_t coefficient_row_bytes = values_per_row * sizeof(float);

  // Three quarters of the budget for coefficients; what they leave is for rows of samples.
  const uint64_t coefficient_budget = params.memory_budget_bytes / 4 * 3;
  TESSERA_ASSIGN_OR_RETURN(
      const std::unique_ptr<CoefficientStore> store,
      CoefficientStore::Create(values_per_row * info.height, coefficient_budget, params.spill_folder));
  const uint64_t block_bytes =
      store->is_spilled() ? sample_row_bytes + 2 * coefficient_row_bytes : sample_row_bytes;
  const uint64_t held_bytes = store->is_spilled() ? 0 : coefficient_row_bytes * info.height;
  const int rows_per_block = RowsWithin(std::min(params.memory_budget_bytes - held_bytes, kMaxRowBlockBytes),
                                        block_bytes, info.height);

  // One stage for the caller: the source's own rows are not told apart from their encoding.
  RunContext source_context = context;
  source_context.progress = nullptr;

  Ranges ranges(k);
  ScratchPool pool;
  HugeBuffer<float> sample_buffer = AllocateHuge<float>(source.SamplesPerRow() * rows_per_block);
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
  TESSERA_RETURN_IF_ERROR(store->Finish());
  sample_buffer.reset();
  context.Report("encode", info.height, info.height, "rows");

  Material material;
  material.width = info.width;
  material.height = info.height;
  material.provenance = info.provenance;
  material.radiometry = info.radiometry;
  BtfelTable& table = material.btfels;
  table.codec_id = model.codec_id;
  table.codec_version = 1;
  table.num_coefficients = static_cast<int>(k);
  table.tables = {{"basis_light", TableOf(model.basis_light)}, {"basis_view", TableOf(model.basis_view)}};
  table.parameters = model.parameters;
  table.views = info.views;
  table.lights = info.lights;
  Quantisation quantisation = UniformQuantisation(ranges.minima, ranges.maxima);
  TESSERA_ASSIGN_OR_RETURN(table.codes, CreateCodes(values_per_row * info.height, params));
  TESSERA_RETURN_IF_ERROR(QuantizeAll(*store, quantisation, table.codes, context));
  table.offset = std::move(quantisation.offset);
  table.step = std::move(quantisation.step);
  return material;
}

// The texels that ridges are chosen by, spread evenly over up to kRidgeRows rows, up to kRidgeTexels of each.
struct RidgeTexels {
  std::vector<Eigen::MatrixXf> projected;  // of one texel's signals over the lights, [kl][(channel, view)]
  std::vector<SignalEnergies> energies;
};

absl::StatusOr<RidgeTexels> ProjectRidgeTexels(const RidgeRegression& light, BtfSource& source,
                                               const RunContext& context) {
  constexpr int kRidgeRows = 8;
  constexpr int kRidgeTexels = 32;
  const BtfInfo& info = source.info();
  const int num_rows = std::min(kRidgeRows, info.height);
  const int texels_per_row = std::min(kRidgeTexels, info.width);
  const auto spread = [](int64_t i, int64_t count, int64_t extent) {
    return (2 * i + 1) * extent / (2 * count);
  };
  RunContext source_context = context;
  source_context.progress = nullptr;
  const auto num_lights = static_cast<Eigen::Index>(info.lights.size());
  const auto num_signals = static_cast<Eigen::Index>(3 * info.views.size());
  RidgeTexels texels;
  texels.projected.resize(static_cast<size_t>(num_rows) * texels_per_row);
  texels.energies.resize(texels.projected.size());
  const HugeBuffer<float> row_buffer = AllocateHuge<float>(source.SamplesPerRow());
  const std::span<float> row(row_buffer.get(), source.SamplesPerRow());
  for (int y = 0; y < num_rows; ++y) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const int source_row = static_cast<int>(spread(y, num_rows, info.height));
    TESSERA_RETURN_IF_ERROR(source.ReadRows(source_row, 1, row, source_context));
    std::atomic<bool> is_legal = true;
    ParallelFor(context, 0, texels_per_row, kRidgeTexelsPerTask, [&](int64_t begin, int64_t end) {
      for (int64_t x = begin; x < end; ++x) {
        const float* const samples =
            row.data() + spread(x, texels_per_row, info.width) * num_lights * num_signals;
        if (!std::all_of(samples, samples + num_lights * num_signals, IsLegalSample)) {
          is_legal = false;
          return;
        }
        const Eigen::MatrixXf signals = Eigen::Map<const Eigen::MatrixXf>(samples, num_lights, num_signals);
        const size_t texel = static_cast<size_t>(int64_t{y} * texels_per_row + x);
        texels.projected[texel] = light.Project(signals);
        texels.energies[texel] = EnergiesOf(signals, texels.projected[texel]);
      }
    });
    if (!is_legal) {
      return IllegalSampleError(info, source_row, row);
    }
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  return texels;
}

// In their order.
SignalEnergies Sum(const std::vector<SignalEnergies>& energies) {
  SignalEnergies sum = energies.front();
  for (size_t texel = 1; texel < energies.size(); ++texel) {
    sum.projected += energies[texel].projected;
    sum.total += energies[texel].total;
  }
  return sum;
}

// Light coefficients of one texel, [kl][(channel, view)], as signals over the views, [views][(channel, i)].
Eigen::MatrixXf ViewSignals(const Eigen::MatrixXf& light_coefficients) {
  const Eigen::Index kl = light_coefficients.rows();
  const Eigen::Index num_views = light_coefficients.cols() / 3;
  Eigen::MatrixXf signals(num_views, 3 * kl);
  for (Eigen::Index channel = 0; channel < 3; ++channel) {
    signals.middleCols(channel * kl, kl) =
        light_coefficients.middleCols(channel * num_views, num_views).transpose();
  }
  return signals;
}

struct Ridges {
  double light = 0.0;
  double view = 0.0;
};

absl::StatusOr<Ridges> ChooseRidges(const RidgeRegression& light, const RidgeRegression& view,
                                    BtfSource& source, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(RidgeTexels texels, ProjectRidgeTexels(light, source, context));
  Ridges ridges;
  ridges.light = light.ChooseRidge(Sum(texels.energies), kDshMaxRidge);
  const Eigen::MatrixXf light_fit = light.FitOfProjected(ridges.light).cast<float>();
  ParallelFor(context, 0, static_cast<int64_t>(texels.projected.size()), kRidgeTexelsPerTask,
              [&](int64_t begin, int64_t end) {
                for (auto texel = static_cast<size_t>(begin); texel < static_cast<size_t>(end); ++texel) {
                  const Eigen::MatrixXf signals = ViewSignals(light_fit * texels.projected[texel]);
                  texels.energies[texel] = EnergiesOf(signals, view.Project(signals));
                }
              });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  ridges.view = view.ChooseRidge(Sum(texels.energies), kDshMaxRidge);
  return ridges;
}

}  // namespace

absl::StatusOr<Material> EncodeDshCls(BtfSource& source, const EncodeParams& params,
                                      const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckInput(source.info(), params));
  return EncodeWith(
      {.codec_id = "dsh-cls",
       .fitter = MakeConstrainedFitter(source.info(), params),
       .basis_light = Eigen::MatrixXd::Identity(params.kl, params.kl),
       .basis_view = Eigen::MatrixXd::Identity(params.kv, params.kv),
       .parameters = {{"kl", params.kl},
                      {"kv", params.kv},
                      {"cls_energy", params.cls_energy == ClsEnergy::kHemisphere ? "hemisphere" : "sphere"}}},
      source, params, context);
}

absl::StatusOr<Material> EncodeDshLs(BtfSource& source, const EncodeParams& params,
                                     const RunContext& context) {
  const BtfInfo& info = source.info();
  TESSERA_RETURN_IF_ERROR(CheckInput(info, params));
  return EncodeWith({.codec_id = "dsh-ls",
                     .fitter = MakeLinearFitter(
                         LeastSquaresFit(DshSamplesOfBasis(info.lights, params.kl), kDshLsSingularFloor),
                         LeastSquaresFit(DshSamplesOfBasis(info.views, params.kv), kDshLsSingularFloor)),
                     .basis_light = Eigen::MatrixXd::Identity(params.kl, params.kl),
                     .basis_view = Eigen::MatrixXd::Identity(params.kv, params.kv),
                     .parameters = {{"kl", params.kl}, {"kv", params.kv}}},
                    source, params, context);
}

absl::StatusOr<Material> EncodeDsh(BtfSource& source, const EncodeParams& params, const RunContext& context) {
  const BtfInfo& info = source.info();
  TESSERA_RETURN_IF_ERROR(CheckInput(info, params));
  Eigen::MatrixXd basis_light = OrthonormalDshBasis(params.kl, DshArgument::kLight, MaxThetaRad(info.lights));
  Eigen::MatrixXd basis_view = OrthonormalDshBasis(params.kv, DshArgument::kView, MaxThetaRad(info.views));
  const RidgeRegression light(DshSamplesOfBasis(info.lights, params.kl) * basis_light.transpose(),
                              DshPenalty(basis_light));
  const RidgeRegression view(DshSamplesOfBasis(info.views, params.kv) * basis_view.transpose(),
                             DshPenalty(basis_view));
  TESSERA_ASSIGN_OR_RETURN(const Ridges ridges, ChooseRidges(light, view, source, context));
  return EncodeWith({.codec_id = "dsh",
                     .fitter = MakeLinearFitter(light.Fit(ridges.light), view.Fit(ridges.view)),
                     .basis_light = std::move(basis_light),
                     .basis_view = std::move(basis_view),
                     .parameters = {{"kl", params.kl},
                                    {"kv", params.kv},
                                    {"ridge_light", ridges.light},
                                    {"ridge_view", ridges.view}}},
                    source, params, context);
}

}  // namespace tessera
