#include <algorithm>
#include <array>
#include <cmath>
#include <csetjmp>
#include <cstdint>
#include <exception>
#include <vector>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfOutputFile.h>
#include <absl/strings/str_cat.h>
#include <png.h>

#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"

namespace tessera {

namespace {

absl::Status CheckShape(const Image& image) {
  if (image.width < 1 || image.height < 1 || image.width > kMaxImageSide || image.height > kMaxImageSide ||
      (image.channels != 1 && image.channels != 3 && image.channels != 4)) {
    return absl::InvalidArgumentError(absl::StrCat("image of ", image.width, "x", image.height, " with ",
                                                   image.channels, " channels; expected 1 to ", kMaxImageSide,
                                                   " on a side and 1, 3 or 4 channels"));
  }
  const size_t expected = static_cast<size_t>(image.width) * image.height * image.channels;
  if (image.pixels.size() != expected) {
    return absl::InvalidArgumentError(
        absl::StrCat("image has ", image.pixels.size(), " samples, expected ", expected));
  }
  return absl::OkStatus();
}

uint8_t CodeFromUnit(double value) {
  // Also false for not-a-number.
  return value > 0.0 ? static_cast<uint8_t>(std::min(value, 1.0) * 255.0 + 0.5) : 0;
}

std::vector<uint8_t> SrgbCodes(const Image& image) {
  std::vector<uint8_t> codes(image.pixels.size());
  for (size_t i = 0; i < codes.size(); ++i) {
    const bool alpha = image.channels == 4 && i % 4 == 3;
    codes[i] = CodeFromUnit(alpha ? image.pixels[i] : SrgbFromLinear(image.pixels[i]));
  }
  return codes;
}

struct PngOutput {
  std::string bytes;
  std::string error;
};

// longjmp leaves this function only past locals without destructors.
bool WritePng(const Image& image, std::span<png_bytep> rows, PngOutput& output) {
  png_structp png = png_create_write_struct(
      PNG_LIBPNG_VER_STRING, &output,
      [](png_structp failed, png_const_charp message) {
        static_cast<PngOutput*>(png_get_error_ptr(failed))->error = message;
        png_longjmp(failed, 1);
      },
      [](png_structp, png_const_charp) {});
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_set_write_fn(
      png, &output,
      [](png_structp sink, png_bytep bytes, size_t count) {
        static_cast<PngOutput*>(png_get_io_ptr(sink))->bytes.append(reinterpret_cast<char*>(bytes), count);
      },
      [](png_structp) {});
  const int colour_type = image.channels == 1   ? PNG_COLOR_TYPE_GRAY
                          : image.channels == 3 ? PNG_COLOR_TYPE_RGB
                                                : PNG_COLOR_TYPE_RGB_ALPHA;
  png_set_IHDR(png, info, image.width, image.height, 8, colour_type, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_set_sRGB(png, info, PNG_sRGB_INTENT_RELATIVE);
  png_set_compression_level(png, 6);
  png_write_info(png, info);
  png_write_image(png, rows.data());
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  return true;
}

class StringStream : public Imf::OStream {
 public:
  StringStream() : OStream("memory") {}
  void write(const char bytes[], int count) override {
    const auto size = static_cast<size_t>(count);
    bytes_.resize(std::max(bytes_.size(), position_ + size));
    std::copy_n(bytes, size, bytes_.begin() + static_cast<ptrdiff_t>(position_));
    position_ += size;
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }

  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
  size_t position_ = 0;
};

}  // namespace

absl::StatusOr<std::string> EncodePng(const Image& image) {
  TESSERA_RETURN_IF_ERROR(CheckShape(image));
  std::vector<uint8_t> codes = SrgbCodes(image);
  std::vector<png_bytep> rows(image.height);
  for (int y = 0; y < image.height; ++y) {
    rows[y] = codes.data() + static_cast<size_t>(y) * image.width * image.channels;
  }
  PngOutput output;
  if (!WritePng(image, rows, output)) {
    return absl::InternalError(absl::StrCat("cannot encode PNG: ", output.error));
  }
  return std::move(output.bytes);
}

absl::StatusOr<std::string> EncodeExr(const Image& image, ExrDepth depth) {
  TESSERA_RETURN_IF_ERROR(CheckShape(image));
  static constexpr std::array<const char*, 4> kRgba = {"R", "G", "B", "A"};
  const Imf::PixelType type = depth == ExrDepth::kHalf ? Imf::HALF : Imf::FLOAT;
  try {
    Imf::Header header(image.width, image.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer frame;
    std::vector<half> halves;
    if (depth == ExrDepth::kHalf) {
      halves.assign(image.pixels.begin(), image.pixels.end());
    }
    const size_t sample_bytes = depth == ExrDepth::kHalf ? sizeof(half) : sizeof(float);
    // OpenEXR's output slices are not const, but it only reads them.
    auto* const base = depth == ExrDepth::kHalf
                           ? reinterpret_cast<char*>(halves.data())
                           : const_cast<char*>(reinterpret_cast<const char*>(image.pixels.data()));
    for (int channel = 0; channel < image.channels; ++channel) {
      const char* const name = image.channels == 1 ? "Y" : kRgba[channel];
      header.channels().insert(name, Imf::Channel(type));
      frame.insert(name, Imf::Slice(type, base + channel * sample_bytes, sample_bytes * image.channels,
                                    sample_bytes * image.channels * image.width));
    }
    StringStream stream;
    {
      Imf::OutputFile file(stream, header, /*numThreads=*/0);
      file.setFrameBuffer(frame);
      file.writePixels(image.height);
    }
    return stream.Take();
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("cannot encode OpenEXR: ", error.what()));
  }
}

}  // namespace tessera
