// The decoder of dfmf as GLSL, with the tables it reads. Same semantics as DfmfDecoder::Evaluate.
#pragma once

#include <span>

#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"
#include "btf/codec/codec.h"

namespace tessera {

// The source depends only on the ranks and the grids' sizes, so that a compiled program serves many
// materials. Packed to 16 bits: coefficients with their offsets folded in, to 2^-16 of the largest magnitude
// of each; factors at pairs of nodes, times that magnitude, with one scale for eight of them, to 2^-16 of the
// largest contribution of any of the eight. Errors: INVALID_ARGUMENT naming the table or parameter that is
// missing or misshapen.
[[nodiscard]] absl::StatusOr<CodecGlsl> DfmfGlsl(const BtfelTable& table,
                                                 std::span<const BtfelTable* const> more = {});

// Beside it, for light of `n` harmonics. Factors at nodes of the views are packed to 16 bits, with one
// scale for eight of them. Cost: a product with each harmonic for each pair of nodes. Errors: the same.
[[nodiscard]] absl::StatusOr<HarmonicsGlsl> DfmfHarmonicsGlsl(const BtfelTable& table,
                                                              std::span<const BtfelTable* const> more, int n);

}  // namespace tessera
