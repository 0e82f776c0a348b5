// Baseline JPEG files as most programs write them: 4:2:0 chroma, here with Huffman tables made for the image.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include <absl/status/statusor.h>

namespace tessera {

// `rgb` holds height x width x 3 codes as they are to be seen (sRGB), row-major. quality: 1..100 in the sense
// of libjpeg. Errors: INVALID_ARGUMENT (sizes, quality), INTERNAL (libjpeg).
[[nodiscard]] absl::StatusOr<std::string> EncodeJpeg(std::span<const uint8_t> rgb, int width, int height,
                                                     int quality);

}  // namespace tessera
