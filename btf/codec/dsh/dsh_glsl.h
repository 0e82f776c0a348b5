// The decoder of dsh* as GLSL, with the tables it reads. Same semantics as DshDecoder::Evaluate.
#pragma once

#include <span>

#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"
#include "btf/codec/codec.h"

namespace tessera {

// For any table of codec "dsh-cls" or one of its relatives. The source depends only on kl, kv and on the form
// of the bases, so that a compiled program serves many materials. Coefficients are packed to 16 bits, as
// multiples of a_i b_j for light function i and view function j: no offsets and steps of their own to fetch,
// which costs several times as much as the codes do. A coefficient is off by at most a_i b_j / 2, and a_i b_j
// is about 2^-15 of the largest value that the coefficients of i and j take, a few times that where these
// magnitudes are far from a product. Errors: INVALID_ARGUMENT naming the table or parameter that is missing
// or misshapen.
[[nodiscard]] absl::StatusOr<CodecGlsl> DshGlsl(const BtfelTable& table,
                                                std::span<const BtfelTable* const> more = {});

// Beside it, for light of `n` harmonics. The source depends on the largest measured polar angle, too. Errors:
// the same.
[[nodiscard]] absl::StatusOr<HarmonicsGlsl> DshHarmonicsGlsl(const BtfelTable& table, int n);

}  // namespace tessera
