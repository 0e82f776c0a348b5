// A linear floating-point image.
#pragma once

#include <cstddef>
#include <vector>

namespace tessera {

// Row-major, interleaved, row 0 on top, linear RGB with sRGB primaries (alpha, where present, is coverage in
// [0, 1]).
struct Image {
  int width = 0;
  int height = 0;
  int channels = 3;  // 1, 3 or 4
  std::vector<float> pixels;

  Image() = default;
  Image(int width, int height, int channels)
      : width(width),
        height(height),
        channels(channels),
        pixels(static_cast<size_t>(width) * height * channels) {}

  float* at(int x, int y) { return pixels.data() + (static_cast<size_t>(y) * width + x) * channels; }
  const float* at(int x, int y) const {
    return pixels.data() + (static_cast<size_t>(y) * width + x) * channels;
  }
};

}  // namespace tessera
