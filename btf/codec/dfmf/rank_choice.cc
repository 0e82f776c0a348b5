#include "btf/codec/dfmf/rank_choice.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <span>

#include "btf/codec/dfmf/angular_factors.h"
#include "btf/codec/dfmf/dfmf_encoder.h"

namespace tessera {
namespace {

// What the container's header, alignment and shared numbers take beyond what is counted one by one.
constexpr uint64_t kHeaderBytes = 6144;

// Components below this share of all energy are rounding of the float products that found them.
constexpr double kRoundingEnergy = 1e-7;

// The gain and cost of every candidate of one list, with the spans of its coefficients.
std::vector<ComponentCost> Costs(const SingularSpace& space, const Smoothings& smoothings, DType dtype,
                                 std::span<const float> spans, uint64_t num_texels, double all_energy) {
  const Eigen::Index pairs = smoothings.light.rows() * smoothings.view.rows();
  const Eigen::Index rank = space.values.size();
  if (rank == 0) {
    return {};
  }
  const std::vector<AngularCodes> parts = QuantizeParts(space.vectors, pairs, dtype);
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
    const double step = spans[k] / 255.0;
    // Uniform rounding errors; the factors have unit norm.
    const double rounding = static_cast<double>(num_texels) * step * step / 12.0;
    const bool is_real = energy > kRoundingEnergy * all_energy;
    costs.push_back({is_real ? energy * (1.0 - errors[k]) - rounding : 0.0, bytes});
  }
  return costs;
}

// Bytes of the container that no component adds to.
uint64_t FixedBytes(const BtfInfo& info) {
  return kHeaderBytes + info.provenance.source.size() + info.provenance.licence.size() +
         info.provenance.citation.size() + info.radiometry.size() +
         12 * (info.views.size() + info.lights.size()) + 36;
}

}  // namespace

Ranks ChooseRanks(const std::vector<ComponentCost>& luma, const std::vector<ComponentCost>& chroma,
                  double energy, uint64_t fixed_bytes, const RankBudget& budget) {
  assert(!luma.empty());
  Ranks ranks{.luma = 1, .squared_error = energy - luma[0].gain, .bytes = fixed_bytes + luma[0].bytes};
  const auto next = [](const std::vector<ComponentCost>& list, int taken) {
    const bool has_more = static_cast<size_t>(taken) < list.size();
    return has_more && list[taken].gain > 0.0 ? list[taken] : ComponentCost{};
  };
  while (ranks.luma + ranks.chroma < budget.max_rank && ranks.squared_error > budget.squared_error) {
    const ComponentCost a = next(luma, ranks.luma);
    const ComponentCost b = next(chroma, ranks.chroma);
    const auto fits = [&](const ComponentCost& c) {
      return c.gain > 0.0 && ranks.bytes + c.bytes <= budget.max_bytes;
    };
    const bool take_luma = fits(a) && (!fits(b) || a.gain * static_cast<double>(b.bytes) >=
                                                       b.gain * static_cast<double>(a.bytes));
    if (!take_luma && !fits(b)) {
      break;
    }
    const ComponentCost& taken = take_luma ? a : b;
    ++(take_luma ? ranks.luma : ranks.chroma);
    ranks.squared_error -= taken.gain;
    ranks.bytes += taken.bytes;
  }
  return ranks;
}

Goal GoalOf(const EncodeParams& params, const BtfInfo& info) {
  const uint64_t num_texels = static_cast<uint64_t>(info.width) * info.height;
  const uint64_t pairs = info.views.size() * info.lights.size();
  constexpr uint64_t kNoLimit = std::numeric_limits<uint64_t>::max() / 2;
  Goal goal{.budget = {.max_rank = 2 * kMaxDfmfRank, .max_bytes = kNoLimit}};
  constexpr int kFirstCandidates = 64;
  int candidates = kFirstCandidates;
  if (params.max_bytes > 0) {
    goal.budget.max_bytes = params.max_bytes;
    candidates =
        static_cast<int>(std::min<uint64_t>(params.max_bytes / (num_texels + pairs) + 1, kMaxDfmfRank));
  } else if (params.max_error > 0.0) {
    goal.budget.squared_error =
        params.max_error * params.max_error * 3.0 * static_cast<double>(num_texels * pairs);
  } else {
    goal.budget.max_rank = params.rank > 0 ? params.rank : kDefaultDfmfRank;
    candidates = goal.budget.max_rank;
  }
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

Choice Choose(const Spaces& spaces, const Smoothings& smoothings, const std::vector<float>& spans,
              double energy, const BtfInfo& info, const EncodeParams& params, const RankBudget& budget) {
  const uint64_t num_texels = static_cast<uint64_t>(info.width) * info.height;
  const std::span<const float> all(spans);
  const auto ranks_with = [&](DType dtype) {
    return ChooseRanks(
        Costs(spaces.luma, smoothings, dtype, all.first(spaces.luma.values.size()), num_texels, energy),
        Costs(spaces.chroma, smoothings, dtype, all.subspan(spaces.luma.values.size()), num_texels, energy),
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

}  // namespace tessera
