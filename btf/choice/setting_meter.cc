#include "btf/choice/setting_meter.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <span>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/choice/dfmf_prefix.h"
#include "btf/codec/codec.h"
#include "btf/codec/container.h"
#include "btf/codec/decoder.h"
#include "btf/codec/dfmf/dfmf_decoder.h"

namespace tessera {
namespace {

constexpr int kSmallFactorisation = 64;
constexpr int kLargeFactorisation = 256;

// `count` different indices below `extent`, ascending; those of a smaller count are among those of a larger.
std::vector<int> GoldenIndices(int count, int extent) {
  const double golden = (std::sqrt(5.0) - 1.0) / 2.0;
  std::set<int> indices;
  if (count >= extent) {
    for (int i = 0; i < extent; ++i) {
      indices.insert(i);
    }
  }
  for (int i = 0; std::cmp_less(indices.size(), std::min(count, extent)); ++i) {
    const double place = golden * (i + 1);
    indices.insert(static_cast<int>((place - std::floor(place)) * extent));
  }
  return {indices.begin(), indices.end()};
}

size_t IndexOf(const std::vector<int>& sorted, int value) {
  return static_cast<size_t>(std::ranges::lower_bound(sorted, value) - sorted.begin());
}

// The table of some of its texels.
BtfelTable OfTexels(const BtfelTable& table, const std::vector<size_t>& texels) {
  std::vector<uint8_t> codes;
  codes.reserve(texels.size() * table.num_coefficients);
  for (const size_t texel : texels) {
    const std::span<const uint8_t> btfel = table.btfel(texel);
    codes.insert(codes.end(), btfel.begin(), btfel.end());
  }
  return {.codec_id = table.codec_id,
          .codec_version = table.codec_version,
          .num_coefficients = table.num_coefficients,
          .offset = table.offset,
          .step = table.step,
          .tables = table.tables,
          .parameters = table.parameters,
          .views = table.views,
          .lights = table.lights,
          .codes = std::move(codes)};
}

// Coefficients of a texel that one look-up between measured directions reads.
int CoefficientsRead(const Decoder& decoder) {
  const Eigen::Vector3d light = VectorFromDirection({RadFromDeg(37.0), RadFromDeg(23.0)});
  const Eigen::Vector3d view = VectorFromDirection({RadFromDeg(23.0), RadFromDeg(211.0)});
  std::set<int> read;
  for (const LinearForm::Run& run : decoder.Form(light, view).runs) {
    for (int i = run.first; i < run.first + run.count; ++i) {
      read.insert(i);
    }
  }
  return static_cast<int>(read.size());
}

}  // namespace

SettingMeter::SettingMeter(BtfSource& source, const EncodeParams& params, const RunContext& context)
    : source_(source), params_(params), context_(context), quiet_(context) {
  quiet_.progress = nullptr;
}

absl::StatusOr<std::unique_ptr<SettingMeter>> SettingMeter::Create(BtfSource& source,
                                                                   const EncodeParams& params,
                                                                   const RunContext& context) {
  const BtfInfo& info = source.info();
  if (!SplitExists(info, Split::kHeldOutLights) && !SplitExists(info, Split::kHeldOutViews)) {
    return absl::FailedPreconditionError(absl::StrCat(
        info.views.size(), " views and ", info.lights.size(), " lights: a choice holds out every ",
        kHeldOutStride, "th direction, so there must be at least ", kHeldOutStride, " views or lights"));
  }
  std::unique_ptr<SettingMeter> meter(new SettingMeter(source, params, context));
  TESSERA_RETURN_IF_ERROR(meter->ReadProbe());
  return meter;
}

absl::Status SettingMeter::ReadProbe() {
  const BtfInfo& info = source_.info();
  const uint64_t texel_bytes = source_.SamplesPerRow() / info.width * sizeof(float);
  const auto most = static_cast<int>(
      std::clamp<uint64_t>(params_.memory_budget_bytes / 8 / texel_bytes, 1, kProbeRows * kProbeColumns));
  const int num_columns = std::min({info.width, kProbeColumns, most});
  const int num_rows = std::min({info.height, kProbeRows, std::max(1, most / num_columns)});
  BtfSubset probe{.columns = GoldenIndices(num_columns, info.width),
                  .rows = GoldenIndices(num_rows, info.height)};

  const int64_t fit_rows = std::max<int64_t>(kFitTexels / info.width, 128);
  fit_.rows = GoldenIndices(static_cast<int>(std::min<int64_t>(fit_rows, info.height)), info.height);
  const int64_t fit_columns =
      std::max<int64_t>(kFitTexels / static_cast<int64_t>(fit_.rows.size()), num_columns);
  fit_.columns = GoldenIndices(static_cast<int>(std::min<int64_t>(fit_columns, info.width)), info.width);
  for (const int row : probe.rows) {
    for (const int column : probe.columns) {
      probe_texels_.push_back(static_cast<size_t>(row) * info.width + column);
      probe_in_fit_.push_back(IndexOf(fit_.rows, row) * fit_.columns.size() + IndexOf(fit_.columns, column));
    }
  }

  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<SubsetBtf> subset, SubsetBtf::Create(source_, probe));
  std::vector<float> samples(subset->SamplesPerRow() * num_rows);
  context_.Report("choose", 0, 0, "settings");
  TESSERA_RETURN_IF_ERROR(subset->ReadRows(0, num_rows, samples, quiet_));
  // In one row, so that an image is decoded in one go.
  BtfInfo in_one_row = subset->info();
  in_one_row.width *= in_one_row.height;
  in_one_row.height = 1;
  TESSERA_ASSIGN_OR_RETURN(probe_, MemoryBtf::Create(std::move(in_one_row), std::move(samples)));
  return absl::OkStatus();
}

absl::StatusOr<Material> SettingMeter::EncodeKept(BtfSource& source, const BtfSubset& texels, Split split,
                                                  const std::string& codec,
                                                  const EncodeParams& params) const {
  BtfSubset kept = EncodedPart(source.info(), split);
  kept.rows = texels.rows;
  kept.columns = texels.columns;
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<SubsetBtf> part, SubsetBtf::Create(source, kept));
  return FindCodec(codec)->Encode(*part, params, quiet_);
}

absl::StatusOr<double> SettingMeter::ErrorOf(BtfelTable table, Split split) const {
  Material material{.width = probe_->info().width, .height = 1, .btfels = std::move(table)};
  TESSERA_ASSIGN_OR_RETURN(
      const PairErrors errors,
      MeasureMaterial(*probe_, material, MeasuredPairs(probe_->info(), split), /*row_stride=*/1, quiet_));
  return Total(errors).rmse();
}

absl::StatusOr<SettingFigures> SettingMeter::CostOf(Material one_texel) const {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(one_texel.btfels));
  one_texel.width = 1;
  one_texel.height = 1;
  TESSERA_ASSIGN_OR_RETURN(const ContainerFile file, MaterialFile(one_texel));
  const BtfInfo& info = source_.info();
  const uint64_t other_texels = static_cast<uint64_t>(info.width) * info.height - 1;
  return SettingFigures{
      .bytes = file.size_bytes() + other_texels * one_texel.btfels.num_coefficients + kRecordBytes,
      .coefficients_read = CoefficientsRead(*decoder)};
}

absl::StatusOr<SettingFigures> SettingMeter::Measure(const std::string& codec, const Setting& setting) {
  TESSERA_RETURN_IF_ERROR(context_.CheckStop());
  context_.Report("choose", ++num_measured_, 0, "settings");
  if (codec == "dfmf") {
    return MeasureDfmf(setting);
  }
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<SubsetBtf> one,
                           SubsetBtf::Create(*probe_, {.columns = {0}, .rows = {0}}));
  TESSERA_ASSIGN_OR_RETURN(Material one_texel, FindCodec(codec)->Encode(*one, setting.params, quiet_));
  TESSERA_ASSIGN_OR_RETURN(SettingFigures figures, CostOf(std::move(one_texel)));
  figures.of_all_texels = std::cmp_equal(probe_texels_.size(), source_.info().width * source_.info().height);
  TESSERA_RETURN_IF_ERROR(AddErrors(figures, [&](Split split) -> absl::StatusOr<double> {
    TESSERA_ASSIGN_OR_RETURN(Material material, EncodeKept(*probe_, {}, split, codec, setting.params));
    return ErrorOf(std::move(material.btfels), split);
  }));
  return figures;
}

absl::StatusOr<SettingFigures> SettingMeter::MeasureWhole(const std::string& codec, const Setting& setting) {
  TESSERA_ASSIGN_OR_RETURN(SettingFigures figures, Measure(codec, setting));
  figures.of_all_texels = true;
  TESSERA_RETURN_IF_ERROR(AddErrors(figures, [&](Split split) -> absl::StatusOr<double> {
    TESSERA_ASSIGN_OR_RETURN(const Material material, EncodeKept(source_, {}, split, codec, setting.params));
    return ErrorOf(OfTexels(material.btfels, probe_texels_), split);
  }));
  return figures;
}

absl::StatusOr<double> SettingMeter::SampledError(const Material& material) const {
  return ErrorOf(OfTexels(material.btfels, probe_texels_), Split::kSampled);
}

absl::Status SettingMeter::AddErrors(SettingFigures& figures,
                                     const std::function<absl::StatusOr<double>(Split)>& error) const {
  if (SplitExists(source_.info(), Split::kHeldOutLights)) {
    TESSERA_ASSIGN_OR_RETURN(figures.lights_rmse, error(Split::kHeldOutLights));
  }
  if (SplitExists(source_.info(), Split::kHeldOutViews)) {
    TESSERA_ASSIGN_OR_RETURN(figures.views_rmse, error(Split::kHeldOutViews));
  }
  return absl::OkStatus();
}

absl::StatusOr<const Material*> SettingMeter::Factorisation(Split split, int rank) {
  const auto found = factorisations_.find({split, rank});
  if (found != factorisations_.end()) {
    return &found->second;
  }
  EncodeParams params = params_;
  params.max_error = 0.0;
  params.max_bytes = 0;
  params.rank = rank;
  TESSERA_ASSIGN_OR_RETURN(Material material, EncodeKept(source_, fit_, split, "dfmf", params));
  return &factorisations_.emplace(std::pair(split, rank), std::move(material)).first->second;
}

absl::StatusOr<SettingFigures> SettingMeter::MeasureDfmf(const Setting& setting) {
  const int rank = setting.params.rank;
  SettingFigures figures;
  const auto error = [&](Split split) -> absl::StatusOr<double> {
    TESSERA_ASSIGN_OR_RETURN(
        const Material* const large,
        Factorisation(split, rank <= kSmallFactorisation ? kSmallFactorisation : kLargeFactorisation));
    const DfmfRanks ranks = DfmfSplit(large->btfels, rank);
    TESSERA_ASSIGN_OR_RETURN(const SettingFigures cost, CostOfDfmf(*large, ranks));
    figures.bytes = std::max(figures.bytes, cost.bytes);
    figures.coefficients_read = std::max(figures.coefficients_read, cost.coefficients_read);
    return ErrorOf(DfmfPrefix(large->btfels, ranks, probe_in_fit_), split);
  };
  TESSERA_RETURN_IF_ERROR(AddErrors(figures, error));
  figures.of_all_texels = std::cmp_equal(fit_.rows.size(), source_.info().height) &&
                          std::cmp_equal(fit_.columns.size(), source_.info().width);
  return figures;
}

absl::StatusOr<SettingFigures> SettingMeter::CostOfDfmf(const Material& kept, const DfmfRanks& ranks) const {
  Material one_texel;
  one_texel.provenance = kept.provenance;
  one_texel.radiometry = kept.radiometry;
  const size_t first = 0;
  one_texel.btfels = DfmfPrefix(kept.btfels, ranks, std::span(&first, 1));
  // Factors of all directions, whatever they are.
  const BtfInfo& info = source_.info();
  one_texel.btfels.views = info.views;
  one_texel.btfels.lights = info.lights;
  for (const char* const name : {kDfmfLuma, kDfmfChroma}) {
    const auto table = one_texel.btfels.tables.find(name);
    if (table != one_texel.btfels.tables.end()) {
      std::vector<int64_t>& shape = table->second.shape;
      shape[shape.size() - 3] = static_cast<int64_t>(info.views.size());
      shape[shape.size() - 2] = static_cast<int64_t>(info.lights.size());
      const int64_t parts = shape.size() == 4 ? shape[0] : 1;
      table->second.values.assign(
          static_cast<size_t>(parts) * info.views.size() * info.lights.size() * shape.back(), 0.0F);
    }
  }
  return CostOf(std::move(one_texel));
}

}  // namespace tessera
