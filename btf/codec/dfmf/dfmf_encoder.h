// Encoding of "dfmf": a truncated singular value decomposition of the whole matrix of samples, in passes over
// the rows of texels.
//
// Pass 1 finds the colour axes (principal axes of RGB over all samples, so that rotating into them keeps
// every squared error) and checks the samples. Three more passes run block Lanczos (math/truncated_svd.h) on
// luminance [views * lights] and, joined, on the two chrominances [2 * views * lights]. The last one takes
// the texels' coefficients. Ranks are chosen then, when what each component gains and costs is known, storage
// included.
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"
#include "btf/data/btf_source.h"

namespace tessera {

// Most components of luminance, and of chrominance, that are ever sought.
inline constexpr int kMaxDfmfRank = 512;

// As Codec::Encode for "dfmf". At most one of params.rank, max_error and max_bytes is set; none: rank
// kDefaultDfmfRank. Holds, besides the result's codes, a row of samples and the angular factors, at most
// params.memory_budget_bytes; float coefficients that exceed it go to an unnamed temporary file. The result
// does not depend on the budget nor on the number of threads. Errors: INVALID_ARGUMENT naming the parameter,
// a direction, or the view, light and texel of a sample that is not finite or too large; FAILED_PRECONDITION
// naming the bound that cannot be met and what can; RESOURCE_EXHAUSTED (temporary folder); CANCELLED;
// whatever the source returns.
[[nodiscard]] absl::StatusOr<Material> EncodeDfmf(BtfSource& source, const EncodeParams& params,
                                                  const RunContext& context);

}  // namespace tessera
