#include "btf/render/composite.h"

#include <charconv>
#include <cstdint>
#include <string>
#include <system_error>

#include <absl/strings/str_cat.h>

#include "btf/image/transfer.h"

namespace tessera {

absl::StatusOr<Background> ParseBackground(std::string_view text) {
  std::string_view digits = text;
  if (digits.starts_with('#')) {
    digits.remove_prefix(1);
  }
  uint32_t colour = 0;
  const char* const end = digits.data() + digits.size();
  const auto [read, error] = std::from_chars(digits.data(), end, colour, 16);
  constexpr size_t kDigits = 6;
  if (digits.size() != kDigits || error != std::errc() || read != end) {
    return absl::InvalidArgumentError(absl::StrCat("background \"", std::string(text),
                                                   "\": expected six hexadecimal digits, as in ffffff"));
  }
  Background background;
  for (int c = 0; c < 3; ++c) {
    const auto code = static_cast<uint8_t>(colour >> (16 - 8 * c));
    background.top[c] = background.bottom[c] = static_cast<float>(LinearFromSrgb(code / 255.0));
  }
  return background;
}

absl::StatusOr<Image> CompositeOver(const Image& picture, const Background& background) {
  if (picture.channels != 4 ||
      picture.pixels.size() != static_cast<size_t>(picture.width) * picture.height * 4) {
    return absl::InvalidArgumentError(
        absl::StrCat("a picture of ", picture.channels, " channels, expected RGBA"));
  }
  Image result(picture.width, picture.height, 3);
  for (int y = 0; y < picture.height; ++y) {
    const float down = (static_cast<float>(y) + 0.5f) / static_cast<float>(picture.height);
    for (int x = 0; x < picture.width; ++x) {
      const float* pixel = picture.at(x, y);
      for (int c = 0; c < 3; ++c) {
        const float behind = (1.0f - down) * background.top[c] + down * background.bottom[c];
        result.at(x, y)[c] = pixel[3] * pixel[c] + (1.0f - pixel[3]) * behind;
      }
    }
  }
  return result;
}

}  // namespace tessera
