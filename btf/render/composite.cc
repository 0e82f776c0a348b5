#include "btf/render/composite.h"

#include <absl/strings/str_cat.h>

namespace tessera {

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
