// What rounding to 8 bits does to double spherical harmonics: the same fit with its coefficients in float.
#pragma once

#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/codec/codec.h"
#include "btf/codec/material.h"
#include "btf/data/memory_btf.h"

namespace tessera {

struct UnroundedFit {
  std::vector<float> coefficients;  // [texel][k], as the codes dequantise
  // The larger of the two passes': of Y^T Y of the basis used at the measured directions, plus the ridge and
  // penalty of "dsh" (in "dsh-cls" lambda differs from signal to signal and is left out).
  double condition = 0.0;
};

// `material` is of codec "dsh-ls", "dsh-cls" or "dsh", made from `source` with `params`. Errors: INTERNAL
// when the fit refuses samples that the encoder took.
[[nodiscard]] absl::StatusOr<UnroundedFit> FitUnrounded(const MemoryBtf& source, const Material& material,
                                                        const EncodeParams& params);

}  // namespace tessera
