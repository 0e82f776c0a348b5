#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "btf/base/status_macros.h"
#include "btf/image/format_readers.h"

namespace tessera {

namespace {

constexpr size_t kRadianceBufferBytes = size_t{1} << 16;
constexpr size_t kMaxRadianceLine = 4096;
constexpr size_t kMaxRadianceHeaderBytes = size_t{1} << 16;
constexpr size_t kMaxQuotedBytes = 64;  // of a header in a message
// Shorter scanlines are never run-length encoded by component, longer ones cannot be.
constexpr int kMinComponentRleWidth = 8;
constexpr int kMaxComponentRleWidth = 0x7fff;
// Of the shared exponent: mantissas are 0..255 for [0, 1), the exponent's zero is at 128.
constexpr int kRgbeExponentBias = 128 + 8;

using Rgbe = std::array<uint8_t, 4>;

// The number that the whole of `text` is, if it is one.
template <typename Number>
std::optional<Number> NumberFrom(std::string_view text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

class RadianceReader : public ImageReader {
 public:
  RadianceReader(std::unique_ptr<ByteStream> stream, std::string name)
      : ImageReader(std::move(name)), stream_(std::move(stream)) {}

  absl::Status Open(const ImageReadOptions& options) {
    TESSERA_RETURN_IF_ERROR(ReadVariables());
    int64_t width = 0;
    int64_t height = 0;
    TESSERA_RETURN_IF_ERROR(ReadResolution(&width, &height));
    TESSERA_RETURN_IF_ERROR(CheckLimits(width, height, options));
    header_ = {ImageFormat::kRadiance, static_cast<int>(width), static_cast<int>(height), 3,
               SampleType::kFloat};
    scanline_.resize(width);
    for (int exponent = 0; exponent < 256; ++exponent) {
      scale_[exponent] = exponent == 0 ? 0.0 : std::ldexp(1.0, exponent - kRgbeExponentBias);
    }
    return absl::OkStatus();
  }

 private:
  absl::Status Damaged(const std::string& what) const {
    return absl::DataLossError(absl::StrCat(name_, ": damaged Radiance picture: ", what));
  }
  absl::Status DamagedRow(const std::string& what) const {
    return Damaged(absl::StrCat("row ", row_, ": ", what));
  }

  // The next bytes of the file, all of them.
  absl::Status Fill(std::span<uint8_t> bytes) {
    for (size_t done = 0; done < bytes.size();) {
      if (position_ == buffered_) {
        buffer_.resize(kRadianceBufferBytes);
        const absl::StatusOr<size_t> count = stream_->Read(std::as_writable_bytes(std::span(buffer_)));
        if (!count.ok()) {
          return absl::Status(count.status().code(), absl::StrCat(name_, ": ", count.status().message()));
        }
        if (*count == 0) {
          return absl::DataLossError(absl::StrCat(name_, ": truncated Radiance picture"));
        }
        position_ = 0;
        buffered_ = *count;
      }
      const size_t count = std::min(bytes.size() - done, buffered_ - position_);
      std::copy_n(buffer_.begin() + static_cast<ptrdiff_t>(position_), count, bytes.begin() + done);
      position_ += count;
      done += count;
    }
    return absl::OkStatus();
  }

  // Up to the next newline, which is taken off.
  absl::StatusOr<std::string> ReadLine() {
    std::string line;
    for (;;) {
      std::array<uint8_t, 1> next{};
      TESSERA_RETURN_IF_ERROR(Fill(next));
      ++header_bytes_;
      if (next[0] == '\n') {
        return line;
      }
      line.push_back(static_cast<char>(next[0]));
      if (line.size() > kMaxRadianceLine || header_bytes_ > kMaxRadianceHeaderBytes) {
        return Damaged(absl::StrCat("header line of more than ", kMaxRadianceLine, " or header of more than ",
                                    kMaxRadianceHeaderBytes, " bytes"));
      }
    }
  }

  absl::Status ReadVariables() {
    TESSERA_ASSIGN_OR_RETURN(const std::string first, ReadLine());
    if (first != "#?RADIANCE" && first != "#?RGBE") {
      return absl::InvalidArgumentError(
          absl::StrCat(name_, ": not a Radiance picture: begins with neither #?RADIANCE nor #?RGBE"));
    }
    for (;;) {
      TESSERA_ASSIGN_OR_RETURN(const std::string line, ReadLine());
      if (line.empty()) {
        return absl::OkStatus();
      }
      const std::vector<std::string> parts = absl::StrSplit(line, absl::MaxSplits('=', 1));
      if (parts.size() == 2) {
        TESSERA_RETURN_IF_ERROR(SetVariable(parts[0], parts[1]));
      }
    }
  }

  absl::Status SetVariable(const std::string& variable, const std::string& text) {
    const std::vector<std::string> values = absl::StrSplit(text, absl::ByAnyChar(" \t\r"), absl::SkipEmpty());
    if (variable == "FORMAT") {
      return values == std::vector<std::string>{"32-bit_rle_rgbe"}
                 ? absl::OkStatus()
                 : absl::InvalidArgumentError(absl::StrCat(name_, ": Radiance picture of format '",
                                                           absl::CHexEscape(text.substr(0, kMaxQuotedBytes)),
                                                           "', 32-bit_rle_rgbe is read"));
    }
    if (variable != "EXPOSURE" && variable != "COLORCORR") {
      return absl::OkStatus();
    }
    // What the samples were multiplied by; several lines add up.
    const size_t count = variable == "EXPOSURE" ? 1 : 3;
    for (size_t i = 0; i < 3; ++i) {
      const std::optional<double> factor =
          values.size() == count ? NumberFrom<double>(values[i % count]) : std::nullopt;
      if (!factor || !(*factor > 0.0) || !std::isfinite(*factor)) {
        return Damaged(absl::StrCat(variable, " is not ", count, " numbers above 0"));
      }
      exposure_[i] *= *factor;
    }
    return absl::OkStatus();
  }

  absl::Status ReadResolution(int64_t* width, int64_t* height) {
    TESSERA_ASSIGN_OR_RETURN(const std::string line, ReadLine());
    const std::vector<std::string> words = absl::StrSplit(line, ' ', absl::SkipEmpty());
    std::array<std::optional<int64_t>, 2> extents;
    if (words.size() == 4) {
      extents = {NumberFrom<int64_t>(words[1]), NumberFrom<int64_t>(words[3])};
    }
    if (!extents[0] || !extents[1]) {
      return Damaged("no resolution after the header, as in -Y 256 +X 512");
    }
    if (words[0] != "-Y" || words[2] != "+X") {
      return absl::InvalidArgumentError(absl::StrCat(name_, ": Radiance picture whose pixels lie as '",
                                                     absl::CHexEscape(line.substr(0, kMaxQuotedBytes)),
                                                     "', only -Y HEIGHT +X WIDTH is read"));
    }
    *height = *extents[0];
    *width = *extents[1];
    return absl::OkStatus();
  }

  absl::Status ReadNextRows(int num_rows, std::span<std::byte> rows) override {
    for (int i = 0; i < num_rows; ++i, ++row_) {
      TESSERA_RETURN_IF_ERROR(ReadScanline());
      std::byte* out = rows.data() + i * RowBytes(header_);
      for (const Rgbe& pixel : scanline_) {
        for (size_t channel = 0; channel < 3; ++channel, out += sizeof(float)) {
          const auto value = static_cast<float>(pixel[channel] * scale_[pixel[3]] / exposure_[channel]);
          std::memcpy(out, &value, sizeof(value));
        }
      }
    }
    if (row_ == header_.height) {
      return stream_->Finish();
    }
    return absl::OkStatus();
  }

  absl::Status ReadScanline() {
    const int width = header_.width;
    Rgbe first{};
    TESSERA_RETURN_IF_ERROR(Fill(first));
    if (width >= kMinComponentRleWidth && width <= kMaxComponentRleWidth && first[0] == 2 && first[1] == 2 &&
        first[2] < 128) {
      if (first[2] * 256 + first[3] != width) {
        return DamagedRow(
            absl::StrCat("scanline of ", first[2] * 256 + first[3], " pixels, expected ", width));
      }
      for (size_t component = 0; component < 4; ++component) {
        TESSERA_RETURN_IF_ERROR(ReadComponent(component));
      }
      return absl::OkStatus();
    }
    return ReadPixels(first);
  }

  // Run-length encoded by component: 1..128 is that many bytes, 129..255 a run of that less 128 of the next.
  absl::Status ReadComponent(size_t component) {
    const int width = header_.width;
    std::array<uint8_t, 128> bytes{};
    for (int x = 0; x < width;) {
      TESSERA_RETURN_IF_ERROR(Fill(std::span(bytes).first(1)));
      const bool is_run = bytes[0] > 128;
      const int count = is_run ? bytes[0] - 128 : bytes[0];
      if (count == 0 || count > width - x) {
        return DamagedRow(absl::StrCat("run of ", count, " pixels at ", x, " of ", width));
      }
      TESSERA_RETURN_IF_ERROR(Fill(std::span(bytes).first(is_run ? 1 : count)));
      for (int i = 0; i < count; ++i) {
        scanline_[x++][component] = bytes[is_run ? 0 : i];
      }
    }
    return absl::OkStatus();
  }

  // Plain pixels, where (1, 1, 1, n) repeats the last one n times; such pixels in a row are the digits of a
  // number to base 256, lowest first.
  absl::Status ReadPixels(Rgbe pixel) {
    const int width = header_.width;
    int shift = 0;
    for (int x = 0;;) {
      if (pixel[0] == 1 && pixel[1] == 1 && pixel[2] == 1) {
        const int64_t count = shift > 16 ? width + int64_t{1} : int64_t{pixel[3]} << shift;
        if (x == 0 || count > width - x) {
          return DamagedRow(absl::StrCat("run of ", count, " pixels at ", x, " of ", width));
        }
        std::fill_n(scanline_.begin() + x, count, scanline_[x - 1]);
        x += static_cast<int>(count);
        shift += 8;
      } else {
        scanline_[x++] = pixel;
        shift = 0;
      }
      if (x == width) {
        return absl::OkStatus();
      }
      TESSERA_RETURN_IF_ERROR(Fill(pixel));
    }
  }

  std::unique_ptr<ByteStream> stream_;
  std::vector<uint8_t> buffer_;
  size_t position_ = 0;  // in buffer_
  size_t buffered_ = 0;
  size_t header_bytes_ = 0;
  std::array<double, 3> exposure_ = {1.0, 1.0, 1.0};
  std::array<double, 256> scale_{};  // of a mantissa, by exponent
  std::vector<Rgbe> scanline_;
  int row_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ImageReader>> OpenRadiance(std::unique_ptr<ByteStream> stream,
                                                          std::string name, const ImageReadOptions& options) {
  auto reader = std::make_unique<RadianceReader>(std::move(stream), std::move(name));
  TESSERA_RETURN_IF_ERROR(reader->Open(options));
  return reader;
}

}  // namespace tessera
