#include "btf/image/image_reader.h"

#include <array>
#include <cstring>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/image/exr_file.h"
#include "btf/image/format_readers.h"
#include "btf/image/image_io.h"

namespace tessera {

namespace {

constexpr size_t kMagicBytes = 8;

// A stream whose first bytes have been looked at: they are given out again before the rest.
class PeekedStream : public ByteStream {
 public:
  PeekedStream(std::unique_ptr<ByteStream> stream, std::span<const std::byte> head)
      : stream_(std::move(stream)), head_size_(head.size()) {
    std::copy(head.begin(), head.end(), head_.begin());
  }

  [[nodiscard]] uint64_t size() const override { return stream_->size(); }
  [[nodiscard]] absl::StatusOr<size_t> Read(std::span<std::byte> bytes) override {
    const size_t from_head = std::min(bytes.size(), head_size_ - position_);
    std::copy_n(head_.begin() + position_, from_head, bytes.begin());
    position_ += from_head;
    if (from_head == bytes.size()) {
      return from_head;
    }
    TESSERA_ASSIGN_OR_RETURN(const size_t rest, stream_->Read(bytes.subspan(from_head)));
    return from_head + rest;
  }
  [[nodiscard]] bool seekable() const override { return false; }
  [[nodiscard]] absl::Status Seek(uint64_t /*position*/) override {
    return absl::InvalidArgumentError("stream cannot seek");
  }
  [[nodiscard]] absl::Status Finish() override { return stream_->Finish(); }

 private:
  std::unique_ptr<ByteStream> stream_;
  std::array<std::byte, kMagicBytes> head_{};
  size_t head_size_;
  size_t position_ = 0;
};

template <size_t kSize>
bool StartsWith(std::span<const std::byte> bytes, const std::array<uint8_t, kSize>& magic) {
  return bytes.size() >= kSize && std::memcmp(bytes.data(), magic.data(), kSize) == 0;
}

constexpr std::array<uint8_t, 8> kPngMagic = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::array<uint8_t, 3> kJpegMagic = {0xff, 0xd8, 0xff};
constexpr std::array<uint8_t, 4> kExrMagic = {0x76, 0x2f, 0x31, 0x01};
constexpr std::array<uint8_t, 2> kRadianceMagic = {'#', '?'};

}  // namespace

absl::Status ImageReader::ReadRows(int num_rows, std::span<std::byte> rows) {
  if (num_rows < 0 || num_rows > header_.height - next_row_ || rows.size() != num_rows * RowBytes(header_)) {
    return absl::InvalidArgumentError(absl::StrCat(name_, ": rows ", next_row_, " + ", num_rows, " of ",
                                                   header_.height, " into ", rows.size(), " bytes"));
  }
  TESSERA_RETURN_IF_ERROR(ReadNextRows(num_rows, rows));
  next_row_ += num_rows;
  return absl::OkStatus();
}

absl::Status ImageReader::CheckLimits(int64_t width, int64_t height, const ImageReadOptions& options) const {
  if (width < 1 || height < 1 || width > kMaxImageSide || height > kMaxImageSide) {
    return absl::InvalidArgumentError(absl::StrCat(name_, ": ", width, "x", height, " pixels, expected 1 to ",
                                                   kMaxImageSide, " on a side"));
  }
  if (working_bytes_ > options.memory_limit_bytes) {
    return absl::ResourceExhaustedError(absl::StrCat(name_, ": needs ", working_bytes_,
                                                     " bytes of memory to decode, the limit is ",
                                                     options.memory_limit_bytes));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<ImageReader>> OpenImage(std::unique_ptr<ByteStream> stream,
                                                       std::string_view name,
                                                       const ImageReadOptions& options) {
  std::string owned_name(name);
  std::array<std::byte, kMagicBytes> buffer{};
  TESSERA_ASSIGN_OR_RETURN(const size_t count, stream->Read(buffer));
  const std::span<const std::byte> head = std::span(buffer).first(count);
  if (stream->seekable()) {
    TESSERA_RETURN_IF_ERROR(stream->Seek(0));
  } else {
    stream = std::make_unique<PeekedStream>(std::move(stream), head);
  }
  if (StartsWith(head, kPngMagic)) {
    return OpenPng(std::move(stream), std::move(owned_name), options);
  }
  if (StartsWith(head, kJpegMagic)) {
    return OpenJpeg(std::move(stream), std::move(owned_name), options);
  }
  if (StartsWith(head, kExrMagic)) {
    TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<ExrFile> file,
                             ExrFile::Open(std::move(stream), std::move(owned_name), options));
    return file->OpenPart(0);
  }
  if (StartsWith(head, kRadianceMagic)) {
    return OpenRadiance(std::move(stream), std::move(owned_name), options);
  }
  return absl::InvalidArgumentError(
      absl::StrCat(owned_name, ": ", count == 0 ? "empty" : "not a PNG, JPEG, OpenEXR or Radiance image"));
}

}  // namespace tessera
