// A material as one flat picture: every texel under the same light, seen from the same direction.
//
//   TESSERA_ASSIGN_OR_RETURN(Image picture, DecodeFlat(material, {.theta_rad = 0.5, .phi_rad = 0}, {}));
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"
#include "btf/image/image.h"
#include "btf/math/conventions.h"

namespace tessera {

// Linear RGB, one pixel a texel: the value of the BTF under an irradiance of pi, >= 0. Angles as the decoder
// takes them (decoder.h): beyond the measured polar angles they are clamped. Errors: those of MakeDecoder,
// INVALID_ARGUMENT when the material is inconsistent, CANCELLED. One row at a time on the calling thread.
[[nodiscard]] absl::StatusOr<Image> DecodeFlat(const Material& material, const Direction& light,
                                               const Direction& view, const RunContext& context = {});

}  // namespace tessera
