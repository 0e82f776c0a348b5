// An animated PNG from PNG files of its frames. Programs that know only PNG show the first.
//
//   TESSERA_ASSIGN_OR_RETURN(std::string animation, AnimatedPng(frames, {.frames_per_second = 25}));
//
// Source: W3C PNG Specification, 3rd edition, 11.3.6 (chunks acTL, fcTL, fdAT).
#pragma once

#include <span>
#include <string>

#include <absl/status/statusor.h>

namespace tessera {

struct AnimationParams {
  int frames_per_second = 25;  // 1..100
  int loops = 0;               // 0: for ever
};

// Each frame replaces the last as a whole; the compressed pixels are taken as they are. `frames`: 1..65535
// PNG files as EncodePng writes them, all of one size and colour type. Errors: INVALID_ARGUMENT naming the
// frame or the parameter.
[[nodiscard]] absl::StatusOr<std::string> AnimatedPng(std::span<const std::string> frames,
                                                      const AnimationParams& params);

}  // namespace tessera
