// The angular side of a factorisation as it is stored, and what storing costs in accuracy.
//
// With A = sum over k of u_k s_k v_k^T + rest, u and v orthonormal and the rest perpendicular to every u_k,
// decoding with w_k in place of v_k leaves the squared error |rest|^2 + sum s_k^2 |w_k - v_k|^2: components
// can be judged one by one.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "btf/codec/btfel_table.h"
#include "btf/codec/container.h"

namespace tessera {

// Factors in codes, one (offset, step) for each factor.
struct AngularCodes {
  CodecTable codes;   // [rows][rank]
  CodecTable offset;  // f32 [rank]
  CodecTable step;    // f32 [rank]
};

// `factors` is [rows][rank], finite, rank >= 1; dtype u8 or u16. Errors are at most half a step.
[[nodiscard]] AngularCodes QuantizeFactors(const Eigen::MatrixXd& factors, DType dtype);
// The inverse, [rows][rank].
[[nodiscard]] Eigen::MatrixXd DequantizeFactors(const AngularCodes& codes);

// |w_k - v_k|^2 of each factor: `factors` [parts * views * lights][rank] against what decodes at the measured
// directions from `stored`, of the same shape, where light_smoothing [lights][lights] and view_smoothing
// [views][views] are the stencils of the grid at those directions times its ResampleMatrix.
[[nodiscard]] Eigen::VectorXd FactorErrors(const Eigen::MatrixXd& factors, const Eigen::MatrixXd& stored,
                                           const Eigen::MatrixXd& light_smoothing,
                                           const Eigen::MatrixXd& view_smoothing);

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

}  // namespace tessera
