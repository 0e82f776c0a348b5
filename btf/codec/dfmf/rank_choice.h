// How many components of luminance and of chrominance "dfmf" stores, and in how many bits: what each
// candidate gains, what it costs, and how far a bound lets them go.
//
//   Goal goal = GoalOf(params, info);
//   const Choice choice = Choose(spaces, smoothings, spans, moments.trace(), info, params, goal.budget);
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "btf/codec/codec.h"
#include "btf/codec/container.h"
#include "btf/codec/dfmf/sample_matrix.h"
#include "btf/data/btf_source.h"

namespace tessera {

// One candidate component.
struct ComponentCost {
  double gain = 0.0;   // squared error that it removes, over all samples; may be negative
  uint64_t bytes = 0;  // that it adds to the container
};

// How far to go in two lists whose components come in order.
struct RankBudget {
  int max_rank = 0;            // of both together
  double squared_error = 0.0;  // stop once no more is left
  uint64_t max_bytes = 0;
};

struct Ranks {
  int luma = 0;
  int chroma = 0;
  double squared_error = 0.0;  // what is left
  uint64_t bytes = 0;
};

// Takes components in turn from the list whose next one gains more a byte, until the budget ends or nothing
// gains; the first of luma always. `energy` is the squared norm of all samples, `fixed_bytes` what the
// container takes without components.
[[nodiscard]] Ranks ChooseRanks(const std::vector<ComponentCost>& luma,
                                const std::vector<ComponentCost>& chroma, double energy, uint64_t fixed_bytes,
                                const RankBudget& budget);

// What the parameters ask for, and how many candidates are worth seeking at first.
struct Goal {
  RankBudget budget;
  int luma_candidates = 0;
  int chroma_candidates = 0;
  int most_luma = 0;  // that there can be
  int most_chroma = 0;
};

// `params` is legal (dfmf_encoder.h).
[[nodiscard]] Goal GoalOf(const EncodeParams& params, const BtfInfo& info);

// What decodes at the measured directions from unit values there, [directions][directions].
struct Smoothings {
  Eigen::MatrixXd light;
  Eigen::MatrixXd view;
};

struct Choice {
  DType dtype = DType::kU8;  // of the factors
  Ranks ranks;
};

// Ranks with 8-bit factors, or with 16-bit ones where they do better: fewer bytes for the error, less error
// for the bytes, or, at a given rank, an error lower by more than a hundredth. `spans` holds maximum -
// minimum of every candidate's coefficients over all texels, luma first; `energy` is the squared norm of all
// samples.
[[nodiscard]] Choice Choose(const Spaces& spaces, const Smoothings& smoothings,
                            const std::vector<float>& spans, double energy, const BtfInfo& info,
                            const EncodeParams& params, const RankBudget& budget);

}  // namespace tessera
