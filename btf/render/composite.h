// A picture with coverage over a background.
#pragma once

#include <string_view>

#include <absl/status/statusor.h>

#include "btf/image/image.h"

namespace tessera {

// Linear RGB of the top and bottom row; rows between blend linearly.
struct Background {
  float top[3] = {0.30f, 0.31f, 0.33f};
  float bottom[3] = {0.13f, 0.13f, 0.14f};
};

// One colour of six hexadecimal digits, sRGB: "ffffff" or "#202830". Errors: INVALID_ARGUMENT naming the
// text.
[[nodiscard]] absl::StatusOr<Background> ParseBackground(std::string_view text);

// RGB: alpha * picture + (1 - alpha) * background. Errors: INVALID_ARGUMENT when `picture` is not RGBA.
[[nodiscard]] absl::StatusOr<Image> CompositeOver(const Image& picture, const Background& background);

}  // namespace tessera
