// Images row by row, in the samples of the file: what an importer needs to read a BTF in bounded memory.
//
//   ImageReadOptions options;
//   options.memory_limit_bytes = budget;
//   TESSERA_ASSIGN_OR_RETURN(auto reader, OpenImage(std::move(stream), "a.jpg", options));
//   std::vector<std::byte> row(RowBytes(reader->header()));
//   for (int y = 0; y < reader->header().height; ++y) { TESSERA_RETURN_IF_ERROR(reader->ReadRows(1, row)); }
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/image/byte_stream.h"
#include "btf/image/transfer.h"

namespace tessera {

enum class ImageFormat { kPng, kJpeg, kExr, kRadiance };

// The transfer curve that files of the format have unless they are known to differ: srgb for PNG and JPEG,
// linear for EXR and Radiance.
constexpr Transfer DefaultTransfer(ImageFormat format) {
  const bool is_linear = format == ImageFormat::kExr || format == ImageFormat::kRadiance;
  return is_linear ? Transfer{TransferKind::kLinear, 1.0} : Transfer{TransferKind::kSrgb, 2.2};
}

enum class SampleType : uint8_t { kU8, kU16, kHalf, kFloat };

constexpr size_t SampleBytes(SampleType type) {
  return type == SampleType::kU8 ? 1 : type == SampleType::kFloat ? 4 : 2;
}

// What a reader delivers; depends on the file and on ImageReadOptions::alpha.
struct ImageHeader {
  ImageFormat format = ImageFormat::kPng;
  int width = 0;     // 1..kMaxImageSide
  int height = 0;    // 1..kMaxImageSide
  int channels = 3;  // 1 gray, 3 RGB, 4 RGB and alpha
  SampleType type = SampleType::kU8;
};

constexpr size_t RowBytes(const ImageHeader& header) {
  return static_cast<size_t>(header.width) * header.channels * SampleBytes(header.type);
}

enum class AlphaUse { kKeep, kDrop };

struct ImageReadOptions {
  AlphaUse alpha = AlphaUse::kKeep;
  // Files that cannot be read row by row (interlaced PNG, progressive JPEG, EXR tiles and compressed EXR in
  // archives) are refused when they need more than this.
  uint64_t memory_limit_bytes = uint64_t{2} << 30;
};

// One pass over one image, top row first. Not thread-safe.
class ImageReader {
 public:
  virtual ~ImageReader() = default;

  [[nodiscard]] const ImageHeader& header() const { return header_; }
  // Estimate of what reading will allocate beyond a few rows, known once open.
  [[nodiscard]] uint64_t working_bytes() const { return working_bytes_; }

  // The next rows, interleaved samples in native byte order. rows.size() must be num_rows *
  // RowBytes(header()). After the last row the rest of the file is checked too. Errors: INVALID_ARGUMENT
  // (size, past the end), DATA_LOSS (truncated or damaged), INTERNAL (medium), all naming the image.
  [[nodiscard]] absl::Status ReadRows(int num_rows, std::span<std::byte> rows);

 protected:
  explicit ImageReader(std::string name) : name_(std::move(name)) {}
  [[nodiscard]] virtual absl::Status ReadNextRows(int num_rows, std::span<std::byte> rows) = 0;
  // INVALID_ARGUMENT or RESOURCE_EXHAUSTED when the header is beyond a limit.
  [[nodiscard]] absl::Status CheckLimits(int64_t width, int64_t height,
                                         const ImageReadOptions& options) const;

  std::string name_;
  ImageHeader header_;
  uint64_t working_bytes_ = 0;
  int next_row_ = 0;
};

// The format is told by the first bytes. Errors as for ReadImage (image_io.h).
[[nodiscard]] absl::StatusOr<std::unique_ptr<ImageReader>> OpenImage(std::unique_ptr<ByteStream> stream,
                                                                     std::string_view name,
                                                                     const ImageReadOptions& options);

}  // namespace tessera
