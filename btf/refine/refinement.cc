#include "btf/refine/refinement.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>
#include <utility>

#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_tables.h"
#include "btf/codec/decoder.h"
#include "btf/refine/scene_cases.h"
#include "btf/refine/set_layers.h"

namespace tessera {
namespace {

// Of the coefficients, the first part.
constexpr double kFirstShare = 1.0 / 32.0;
constexpr double kPrefixGrowth = 1.41421356237;
constexpr uint32_t kMostExactParts = 512;

uint32_t FirstEnd(size_t k) {
  return static_cast<uint32_t>(std::ceil(kFirstShare * static_cast<double>(k)));
}

// Of the prefixes where there are layers: the first before them, the others behind.
std::vector<uint32_t> EndsAroundLayers(const BtfelTable& table) {
  const auto k = static_cast<uint32_t>(table.num_coefficients);
  const auto count = static_cast<uint32_t>(
      std::max<size_t>({1, kExactPartBytes / std::max<size_t>(table.size(), 1), k / kMostExactParts}));
  std::vector<uint32_t> ends;
  for (uint32_t end = FirstEnd(k); end < k; end += std::min(count, k - end)) {
    ends.push_back(end);
  }
  ends.push_back(k);
  return ends;
}

// Without layers.
std::vector<uint32_t> GrowingEnds(size_t k) {
  std::vector<uint32_t> ends;
  for (double end = FirstEnd(k); end < static_cast<double>(k);
       end = std::max(std::ceil(end * kPrefixGrowth), end + 1.0)) {
    ends.push_back(static_cast<uint32_t>(end));
  }
  ends.push_back(static_cast<uint32_t>(k));
  return ends;
}

// Means over the rows, 0 where a coefficient needs entries of tables.
std::vector<float> FillOf(const CoefficientTables& tables, const FloatRows& values) {
  std::vector<float> fill(values.cols(), 0.0F);
  for (Eigen::Index i = 0; i < values.cols(); ++i) {
    if (!tables.NeedsEntries(static_cast<uint32_t>(i)) && values.rows() > 0) {
      fill[i] = static_cast<float>(values.col(i).cast<double>().mean());
    }
  }
  return fill;
}

}  // namespace

absl::StatusOr<Refinement> MakeRefinement(const TileSet& tile_set, const RefinementOptions& options,
                                          const RunContext& context) {
  const BtfelTable& table = tile_set.btfels;
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table));
  TESSERA_ASSIGN_OR_RETURN(const CoefficientTables tables, CoefficientTables::Of(table));
  const SceneCases cases = MakeSceneCases(*decoder, table, options.light);
  const auto k = static_cast<size_t>(table.num_coefficients);
  Refinement refinement;
  refinement.directions = cases.directions;
  TileSetCut& cut = refinement.cut;
  if (options.level > 0) {
    TESSERA_ASSIGN_OR_RETURN(
        SetLayers layers,
        MakeSetLayers(tile_set, {.level = options.level, .exact = {}, .light = options.light}, context));
    cut.fill.assign(k, 0.0F);
    cut.layers = std::move(layers.layers);
    refinement.rmse = std::move(layers.rmse);
    return refinement;
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  const FloatRows values = CoefficientsOf(table, SampleTexels(tile_set, 0).btfels);
  const FloatRows whole = values * cases.weights.transpose();
  cut.fill = FillOf(tables, values);
  const Eigen::Map<const Eigen::RowVectorXf> fill(cut.fill.data(), static_cast<Eigen::Index>(k));
  std::vector<double> energy(k);
  for (size_t i = 0; i < k; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    energy[i] = cases.weights.col(column).cast<double>().squaredNorm() *
                (values.col(column).array() - fill[column]).cast<double>().matrix().squaredNorm();
  }
  cut.order.resize(k);
  std::iota(cut.order.begin(), cut.order.end(), 0U);
  std::ranges::stable_sort(cut.order, [&](uint32_t a, uint32_t b) { return energy[a] > energy[b]; });
  const auto rmse_of = [&](uint32_t end) {
    FloatRows prefix = values;
    for (size_t i = end; i < k; ++i) {
      prefix.col(cut.order[i]).setConstant(fill[cut.order[i]]);
    }
    return RmseOf(prefix * cases.weights.transpose(), whole);
  };
  if (k <= kMostComponents) {
    for (const uint32_t end : GrowingEnds(k)) {
      TESSERA_RETURN_IF_ERROR(context.CheckStop());
      const double rmse = end == k ? 0.0 : rmse_of(end);
      // One that would not lower the error is joined with the next.
      if (refinement.rmse.empty() || rmse < refinement.rmse.back() || end == k) {
        cut.ends.push_back(end);
        refinement.rmse.push_back(rmse);
      }
    }
    return refinement;
  }
  cut.ends = EndsAroundLayers(table);
  refinement.rmse.push_back(rmse_of(cut.ends[0]));
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  TESSERA_ASSIGN_OR_RETURN(SetLayers layers, MakeSetLayers(tile_set,
                                                           {.exact = std::span(cut.order).first(cut.ends[0]),
                                                            .rmse = refinement.rmse.back(),
                                                            .light = options.light},
                                                           context));
  cut.layers = layers.layers->layers.empty() ? nullptr : std::move(layers.layers);
  refinement.rmse.insert(refinement.rmse.end(), layers.rmse.begin(), layers.rmse.end());
  refinement.rmse.insert(refinement.rmse.end(), cut.ends.size() - 1, refinement.rmse.back());
  refinement.rmse.back() = 0.0;
  return refinement;
}

}  // namespace tessera
