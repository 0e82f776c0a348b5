// What encoders refuse before and while they read: misshapen BTFs and samples that no picture can have.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include <absl/status/status.h>

#include "btf/data/btf_source.h"

namespace tessera {

// Samples beyond this are refused: their squares must add up in float.
inline constexpr float kLargestSample = 1e12F;

[[nodiscard]] inline bool IsLegalSample(float f) {
  return std::abs(f) <= kLargestSample;
}

// Errors: INVALID_ARGUMENT naming an empty extent, a direction set that is empty or larger than
// `max_directions`, or a direction that is not finite or below the horizon.
[[nodiscard]] absl::Status CheckEncoderInput(const BtfInfo& info,
                                             size_t max_directions = std::numeric_limits<size_t>::max());

// Names view, light, texel and channel of the first illegal one of `samples`, which start at row `row_begin`
// in ReadRows' layout. INVALID_ARGUMENT; INTERNAL if all are legal.
[[nodiscard]] absl::Status IllegalSampleError(const BtfInfo& info, int row_begin,
                                              std::span<const float> samples);

}  // namespace tessera
