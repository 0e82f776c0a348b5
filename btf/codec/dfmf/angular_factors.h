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
// The same for each part of `part_rows` rows by itself.
[[nodiscard]] std::vector<AngularCodes> QuantizeParts(const Eigen::MatrixXd& factors, Eigen::Index part_rows,
                                                      DType dtype);
// The inverse, [rows][rank].
[[nodiscard]] Eigen::MatrixXd DequantizeFactors(const AngularCodes& codes);

// |w_k - v_k|^2 of each factor: `factors` [parts * views * lights][rank] against what decodes at the measured
// directions from `stored`, of the same shape, where light_smoothing [lights][lights] and view_smoothing
// [views][views] are the stencils of the grid at those directions times its ResampleMatrix.
[[nodiscard]] Eigen::VectorXd FactorErrors(const Eigen::MatrixXd& factors, const Eigen::MatrixXd& stored,
                                           const Eigen::MatrixXd& light_smoothing,
                                           const Eigen::MatrixXd& view_smoothing);

}  // namespace tessera
