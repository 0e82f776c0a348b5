// A picture as a texture takes it.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/image/image.h"

namespace tessera::viewer {

// 8 bits, sRGB, opaque.
struct Pixels {
  int width = 0;
  int height = 0;
  std::vector<uint8_t> rgba;  // [height][width][4], row 0 on top
};

// Of linear RGB, rounded to nearest, clamped to [0, 1]; not-a-number becomes 0. Errors: INVALID_ARGUMENT
// naming the channels, where they are not three.
[[nodiscard]] absl::StatusOr<Pixels> PixelsOf(const Image& picture);

}  // namespace tessera::viewer
