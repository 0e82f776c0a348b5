// Encoding by constrained least squares in two passes: over the lights of every view, then over the views of
// every light coefficient. Source: [Leung2007] 3.1, 5 and appendix; closed form as in
// math/constrained_least_squares.h.
//
// Rows of texels are streamed. Each group of texels takes two large products for each pass (onto the
// eigenvectors of the direction set, back to harmonics) and one vectorised search for lambda in between;
// nothing is solved for a single texel.
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"
#include "btf/data/btf_source.h"

namespace tessera {

// Samples beyond this are refused: their squares must add up in float.
inline constexpr float kMaxSample = 1e12F;

// As Codec::Encode for "dsh-cls". Holds, besides the result's codes and at least one row of samples, at most
// params.memory_budget_bytes; float coefficients that exceed it go to an unnamed temporary file. The result
// does not depend on the budget nor on the number of threads. Errors: INVALID_ARGUMENT naming kl, kv, a
// direction or the view, light and texel of a sample that is not finite or beyond kMaxSample;
// RESOURCE_EXHAUSTED (temporary folder); CANCELLED; whatever the source returns.
[[nodiscard]] absl::StatusOr<Material> EncodeDshCls(BtfSource& source, const EncodeParams& params,
                                                    const RunContext& context);

}  // namespace tessera
