// Image files for tests, as other programs would write them: of any sample width, and damaged on purpose.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "btf/image/image.h"

namespace tessera {

// Codes of an image, row-major and interleaved; 8-bit codes are in the low byte.
struct CodeImage {
  int width = 0;
  int height = 0;
  int channels = 3;  // 1 gray, 2 gray and alpha, 3 RGB, 4 RGBA
  std::vector<uint16_t> codes;

  CodeImage(int width, int height, int channels)
      : width(width),
        height(height),
        channels(channels),
        codes(static_cast<size_t>(width) * height * channels) {}
  uint16_t& at(int x, int y, int channel) {
    return codes[(static_cast<size_t>(y) * width + x) * channels + channel];
  }
};

enum class PngLayout { kPlain, kInterlaced };
// bits: 8 or 16.
[[nodiscard]] std::string MakePng(const CodeImage& image, int bits, PngLayout layout = PngLayout::kPlain);
// A PNG of that size and type with its header alone: valid to whoever looks only there.
[[nodiscard]] std::string MakePngHeader(int width, int height, int channels, int bits);

enum class JpegLayout { kBaseline, kProgressive };
// Quality 100, no chroma subsampling. channels: 1, 3 or 4 (4 is written as CMYK).
[[nodiscard]] std::string MakeJpeg(const CodeImage& image, JpegLayout layout = JpegLayout::kBaseline);

enum class RadianceLayout { kPlain, kPixelRuns, kComponentRuns };
// A Radiance picture whose pixels are the image's four channels, red, green, blue and exponent. `variables`
// are lines for its header, each ended by a newline.
[[nodiscard]] std::string MakeRadiance(const CodeImage& image, RadianceLayout layout,
                                       const std::string& variables = "FORMAT=32-bit_rle_rgbe\n");

}  // namespace tessera
