// The embedding of dsh*: principal components of the Gram-weighted coefficients over the exemplar in all four
// quarter turns.
//
// With f = sum over i, j of yl_i yv_j c_ij, the integral of f^2 over both hemispheres is the squared norm of
// Gv^(1/2) C Gl^(1/2), where Gl and Gv are the Gram matrices of the harmonics as they decode (clamped beyond
// the largest measured polar angle, zero below the horizon). The symmetric square roots commute with turns
// about the normal, so in weighted coefficients, too, a quarter turn is a signed permutation, and the
// covariance over four turns is made from that of one.
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"

namespace tessera {

// As Codec::Embed for tables that DshDecoder decodes; dims beyond the number of coefficients k are not given,
// so result.dims = min(dims, k). Determinism, memory and cost are those of EmbedFeatures (feature_pca.h) with
// F = k. Errors: INVALID_ARGUMENT (dims < 1, a misshapen material), CANCELLED.
[[nodiscard]] absl::StatusOr<Embedding> EmbedDsh(const Material& material, int dims,
                                                 const RunContext& context);

}  // namespace tessera
