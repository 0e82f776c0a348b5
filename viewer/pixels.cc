#include "viewer/pixels.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>

#include "btf/image/transfer.h"

namespace tessera::viewer {
namespace {

// A unit of linear light is cut into this many steps: 16 of them at the steepest 8-bit step of the sRGB
// curve.
constexpr int kCurveSteps = 1 << 16;

const std::vector<uint8_t>& SrgbCodes() {
  static const std::vector<uint8_t> codes = [] {
    std::vector<uint8_t> table(kCurveSteps + 1);
    for (int i = 0; i <= kCurveSteps; ++i) {
      table[i] =
          static_cast<uint8_t>(std::lround(255.0 * SrgbFromLinear(static_cast<double>(i) / kCurveSteps)));
    }
    return table;
  }();
  return codes;
}

}  // namespace

absl::StatusOr<Pixels> PixelsOf(const Image& picture) {
  if (picture.channels != 3) {
    return absl::InvalidArgumentError(
        absl::StrCat("a picture of ", picture.channels, " channels, expected 3"));
  }
  const std::vector<uint8_t>& codes = SrgbCodes();
  Pixels pixels{picture.width, picture.height, {}};
  const size_t count = static_cast<size_t>(picture.width) * picture.height;
  pixels.rgba.resize(count * 4, 255);
  for (size_t i = 0; i < count; ++i) {
    for (int c = 0; c < 3; ++c) {
      const float value = picture.pixels[i * 3 + c];
      // Not-a-number compares false: it becomes 0.
      const float clamped = value > 0.0F ? std::min(value, 1.0F) : 0.0F;
      pixels.rgba[i * 4 + c] = codes[static_cast<size_t>(clamped * kCurveSteps + 0.5F)];
    }
  }
  return pixels;
}

}  // namespace tessera::viewer
