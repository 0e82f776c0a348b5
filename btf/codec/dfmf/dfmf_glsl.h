// The decoder of dfmf as GLSL, with the tables it reads. Same semantics as DfmfDecoder::Evaluate.
#pragma once

#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"
#include "btf/codec/codec.h"

namespace tessera {

// The source depends only on the ranks and the grids' sizes, so that a compiled program serves many
// materials. Factors at pairs of nodes, times their coefficient's step, are packed to 16 bits with one scale
// for eight of them: their error is at most 2^-16 of the largest contribution of any of the eight. Errors:
// INVALID_ARGUMENT naming the table or parameter that is missing or misshapen.
[[nodiscard]] absl::StatusOr<CodecGlsl> DfmfGlsl(const BtfelTable& table);

}  // namespace tessera
