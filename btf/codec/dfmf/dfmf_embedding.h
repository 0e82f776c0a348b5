// The embedding of dfmf: principal components of BTFels as functions of light and view, in all four quarter
// turns.
//
// A BTFel is f = sum over k of c_k phi_k(light, view), and turned by t it is the same sum of phi_k with both
// directions turned. The 4 k turned functions span all there is, their Gram matrix over both hemispheres is
// found by quadrature, and PCA works on coordinates in an orthonormal basis of that span: no image is
// decoded.
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"

namespace tessera {

// As Codec::Embed for "dfmf"; result.dims = min(dims, 4 k). Distances are those of the decoded function
// before its clamp at 0, exact up to the quadrature (160 directions on either side). Deterministic for any
// number of threads; the sign of a component makes the largest element of its axis positive. Cost: about 10^5
// evaluations of the factors, an eigendecomposition of size 4 k. Errors: INVALID_ARGUMENT (dims < 1, a
// misshapen material), CANCELLED.
[[nodiscard]] absl::StatusOr<Embedding> EmbedDfmf(const Material& material, int dims,
                                                  const RunContext& context);

}  // namespace tessera
