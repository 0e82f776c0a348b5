// Encoding by double spherical harmonics, three ways to fit them:
//
//   dsh-cls  constrained least squares: the coefficients' energy is bounded by the signal's
//   dsh-ls   plain least squares; coefficients grow to 5e4 and do not survive 8 bits. Kept to show it.
//   dsh      harmonics orthonormalised over the hemisphere, their size and roughness penalised (dsh_basis.h),
//            one ridge a pass, chosen by generalised cross-validation (math/ridge.h) on up to 256 texels
//            spread over the texture
//
// Rows of texels are streamed, groups of texels fitted at once (dsh_fitter.h). Source of the first:
// [Leung2007] 3.1, 5 and appendix; the last is ours.
// One ridge serves a pass, not one for each signal: the directions decide how much of a signal can be told.
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"
#include "btf/data/btf_source.h"

namespace tessera {

// Singular values of the samples of the harmonics below this share of the largest count as 0: in single
// precision there is nothing beneath them, and with fewer directions than functions they are 0.
inline constexpr double kDshLsSingularFloor = 1e-6;

// The largest ridge of "dsh", relative to the largest eigenvalue of the direction set: 1% at most is lost of
// what all directions agree on. Cross-validation asks for more where the functions cannot follow the signals
// (glossy reactdiffuse: 0.04, which gains 0.1% on held-out lights) and would rather predict black where there
// are fewer directions than functions.
inline constexpr double kDshMaxRidge = 0.01;

// As Codec::Encode. Hold, besides the result's codes and at least one row of samples, at most
// params.memory_budget_bytes; float coefficients that exceed it go to an unnamed temporary file. The result
// does not depend on the budget nor on the number of threads. "dsh" reads up to 8 rows twice. Errors:
// INVALID_ARGUMENT naming kl, kv, a direction or the view, light and texel of a sample that is not finite or
// beyond kLargestSample (encoder_input.h); RESOURCE_EXHAUSTED (temporary folder); CANCELLED; whatever the
// source returns.
[[nodiscard]] absl::StatusOr<Material> EncodeDshCls(BtfSource& source, const EncodeParams& params,
                                                    const RunContext& context);
[[nodiscard]] absl::StatusOr<Material> EncodeDshLs(BtfSource& source, const EncodeParams& params,
                                                   const RunContext& context);
[[nodiscard]] absl::StatusOr<Material> EncodeDsh(BtfSource& source, const EncodeParams& params,
                                                 const RunContext& context);

}  // namespace tessera
