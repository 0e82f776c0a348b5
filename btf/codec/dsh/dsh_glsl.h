// The decoder of dsh* as GLSL, with the tables it reads. Same semantics as DshDecoder::Evaluate.
#pragma once

#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"
#include "btf/codec/codec.h"

namespace tessera {

// For any table of codec "dsh-cls" or one of its relatives. The source depends only on kl, kv and on whether
// the bases are the identity and turn like it, so that a compiled program serves many materials. Errors:
// INVALID_ARGUMENT naming the table or parameter that is missing or misshapen.
[[nodiscard]] absl::StatusOr<CodecGlsl> DshGlsl(const BtfelTable& table);

}  // namespace tessera
