#include "btf/codec/dfmf/dfmf_encoder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_store.h"
#include "btf/codec/dfmf/angular_factors.h"
#include "btf/codec/dfmf/dfmf_decoder.h"
#include "btf/codec/dfmf/direction_grid.h"
#include "btf/codec/dfmf/rank_choice.h"
#include "btf/codec/dfmf/resample_choice.h"
#include "btf/codec/dfmf/sample_matrix.h"
#include "btf/codec/encoder_input.h"
#include "btf/codec/quantize.h"
#include "btf/codec/row_passes.h"

namespace tessera {
namespace {

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
  return CheckEncoderInput(info, kMaxDfmfDirections);
}

struct Ranges {
  std::vector<float> minima;
  std::vector<float> maxima;
};

std::vector<float> Spans(const Ranges& ranges) {
  std::vector<float> spans(ranges.minima.size());
  for (size_t i = 0; i < spans.size(); ++i) {
    spans[i] = ranges.maxima[i] - ranges.minima[i];
  }
  return spans;
}

// Coefficients of all candidate components, [texel][k], into `store`; their ranges.
absl::StatusOr<Ranges> ProjectTexels(const SampleMatrix& matrix, const Spaces& spaces,
                                     CoefficientStore& store, int width, RowPasses& passes) {
  const Eigen::MatrixXf luma = spaces.luma.vectors.cast<float>();
  const Eigen::MatrixXf chroma = spaces.chroma.vectors.cast<float>();
  const Eigen::Index k = luma.cols() + chroma.cols();
  Eigen::ArrayXf minima = Eigen::ArrayXf::Constant(k, std::numeric_limits<float>::infinity());
  Eigen::ArrayXf maxima = -minima;
  TESSERA_RETURN_IF_ERROR(passes.Run([&](const SampleBlock& block) -> absl::Status {
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
  TESSERA_RETURN_IF_ERROR(store.Finish());
  return Ranges{{minima.begin(), minima.end()}, {maxima.begin(), maxima.end()}};
}

void AddSideParameters(const std::string& name, size_t num_directions, const ResampleRule& rule,
                       nlohmann::json& parameters) {
  parameters[name + "_nodes"] = ResampleNodesPerSide(num_directions);
  parameters[name + "_trend"] = rule.trend;
  parameters[name + "_bend"] = rule.bend;
  parameters[name + "_range"] = rule.range;
  parameters[name + "_detail"] = rule.detail;
  parameters[name + "_detail_range"] = rule.detail_range;
}

void AddTables(const Spaces& spaces, const Choice& choice, int64_t num_views, int64_t num_lights,
               BtfelTable& table) {
  const Eigen::Index pairs = num_views * num_lights;
  std::vector<AngularCodes> luma =
      QuantizeParts(spaces.luma.vectors.leftCols(choice.ranks.luma), pairs, choice.dtype);
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
  for (const AngularCodes& part : QuantizeParts(spaces.chroma.vectors.leftCols(q), pairs, choice.dtype)) {
    codes.values.insert(codes.values.end(), part.codes.values.begin(), part.codes.values.end());
    offset.values.insert(offset.values.end(), part.offset.values.begin(), part.offset.values.end());
    step.values.insert(step.values.end(), part.step.values.begin(), part.step.values.end());
  }
  table.tables[kDfmfChroma] = std::move(codes);
  table.tables[kDfmfChromaOffset] = std::move(offset);
  table.tables[kDfmfChromaStep] = std::move(step);
}

// The chosen coefficients of every texel, quantised into table.codes.
absl::Status QuantizeTexels(const CoefficientStore& store, const Ranges& ranges, Eigen::Index luma_candidates,
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
  std::vector<float> scratch;
  for (uint64_t begin = 0; begin < num_texels; begin += kTexelsPerBlock) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const uint64_t count = std::min(kTexelsPerBlock, num_texels - begin);
    TESSERA_ASSIGN_OR_RETURN(const std::span<const float> values,
                             store.Read(begin * candidates, count * candidates, scratch));
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
  Goal goal = GoalOf(params, info);
  while (true) {
    TESSERA_ASSIGN_OR_RETURN(const Spaces spaces,
                             FindSpaces(matrix, pairs, goal.luma_candidates, goal.chroma_candidates, passes));
    const Eigen::Index candidates = spaces.luma.values.size() + spaces.chroma.values.size();
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<CoefficientStore> store,
                             CoefficientStore::Create(num_texels * candidates, params.memory_budget_bytes / 2,
                                                      params.spill_folder));
    TESSERA_ASSIGN_OR_RETURN(const Ranges ranges, ProjectTexels(matrix, spaces, *store, info.width, passes));
    const SideGrams grams = MakeSideGrams(spaces, num_views, num_lights);
    const ResampleRule light_rule = ChooseResampleRule(info.lights, grams.light);
    const ResampleRule view_rule = ChooseResampleRule(info.views, grams.view);
    const Smoothings smoothings{Smoothing(info.lights, light_rule), Smoothing(info.views, view_rule)};
    const Choice choice =
        Choose(spaces, smoothings, Spans(ranges), moments.trace(), info, params, goal.budget);
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
    table.parameters = {{"ridge", light_rule.ridge}, {"nugget", light_rule.nugget}};
    AddSideParameters("light", info.lights.size(), light_rule, table.parameters);
    AddSideParameters("view", info.views.size(), view_rule, table.parameters);
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
