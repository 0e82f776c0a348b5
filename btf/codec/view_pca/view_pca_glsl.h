// The decoder of "view-pca" as GLSL, with the tables it reads. Same semantics as ViewPcaDecoder.
#pragma once

#include <span>

#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"
#include "btf/codec/codec.h"

namespace tessera {

// The source depends only on the number of eigen-textures, so that a compiled program serves many materials.
// Each view's codes start at a texel of four words. Errors: INVALID_ARGUMENT as ViewPcaDecoder::Create, or
// when the codes are not whole BTFels.
[[nodiscard]] absl::StatusOr<CodecGlsl> ViewPcaGlsl(const BtfelTable& table,
                                                    std::span<const BtfelTable* const> more = {});

// Beside it, for light of `n` harmonics. Errors: INVALID_ARGUMENT as ViewPcaDecoder::Create.
[[nodiscard]] absl::StatusOr<HarmonicsGlsl> ViewPcaHarmonicsGlsl(const BtfelTable& table, int n);

}  // namespace tessera
