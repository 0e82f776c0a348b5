#include "btf/refine/refinement.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>

#include <absl/strings/str_cat.h>
#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_tables.h"
#include "btf/codec/decoder.h"
#include "btf/refine/scene_cases.h"

namespace tessera {
namespace {

// Of the coefficients, the first prefix; each further one is kPrefixGrowth times as long.
constexpr double kFirstShare = 1.0 / 32.0;
constexpr double kPrefixGrowth = 1.41421356237;

std::vector<uint32_t> PrefixEnds(size_t k) {
  std::vector<uint32_t> ends;
  for (double end = std::max(1.0, std::ceil(kFirstShare * static_cast<double>(k)));
       end < static_cast<double>(k); end = std::max(std::ceil(end * kPrefixGrowth), end + 1.0)) {
    ends.push_back(static_cast<uint32_t>(end));
  }
  ends.push_back(static_cast<uint32_t>(k));
  return ends;
}

// Means over the texels, 0 where a coefficient needs entries of tables; the values become differences to
// them.
absl::StatusOr<std::vector<float>> TakeFill(const BtfelTable& table, FloatRows& values) {
  TESSERA_ASSIGN_OR_RETURN(const CoefficientTables tables, CoefficientTables::Of(table));
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
FloatRows Permuted(const Eigen::Ref<const FloatRows>& from, std::span<const uint32_t> order) {
  FloatRows to(from.rows(), from.cols());
  for (size_t i = 0; i < order.size(); ++i) {
    to.col(static_cast<Eigen::Index>(i)) = from.col(order[i]);
  }
  return to;
}

}  // namespace

absl::StatusOr<Refinement> MakeRefinement(const TileSet& tile_set, SceneLight light,
                                          const RunContext& context) {
  const BtfelTable& table = tile_set.btfels;
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table));
  const auto k = static_cast<size_t>(table.num_coefficients);
  const SceneCases cases = MakeSceneCases(*decoder, table, light);
  Refinement refinement;
  refinement.directions = cases.directions;
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  TESSERA_ASSIGN_OR_RETURN(FloatRows values,
                           CoefficientsOf(tile_set, Spread(tile_set.tile_index.size(), kRefineTexels)));
  TESSERA_ASSIGN_OR_RETURN(refinement.fill, TakeFill(table, values));

  std::vector<double> energy(k);
  for (size_t i = 0; i < k; ++i) {
    const auto column = static_cast<Eigen::Index>(i);
    energy[i] = cases.weights.col(column).cast<double>().squaredNorm() *
                values.col(column).cast<double>().squaredNorm();
  }
  refinement.order.resize(k);
  std::iota(refinement.order.begin(), refinement.order.end(), 0U);
  std::ranges::stable_sort(refinement.order, [&](uint32_t a, uint32_t b) { return energy[a] > energy[b]; });

  // [texels][3 * cases]: first of the fill alone, then of more and more coefficients.
  const Eigen::Map<const Eigen::RowVectorXf> fill(refinement.fill.data(), static_cast<Eigen::Index>(k));
  const FloatRows base = (fill * cases.weights.transpose()).replicate(values.rows(), 1);
  const FloatRows weights = Permuted(cases.weights, refinement.order);
  values = Permuted(values, refinement.order);
  FloatRows whole = base;
  whole.noalias() += values * weights.transpose();
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  FloatRows value = base;
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
