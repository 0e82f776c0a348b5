#include <bit>
#include <csetjmp>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <png.h>

#include "btf/base/status_macros.h"
#include "btf/image/format_readers.h"

namespace tessera {

namespace {

// Ancillary chunks (text, profiles) are skipped, but libpng holds one at a time.
constexpr png_alloc_size_t kMaxChunkBytes = 8 << 20;
constexpr int kMaxCachedChunks = 128;

class PngReader : public ImageReader {
 public:
  PngReader(std::unique_ptr<ByteStream> stream, std::string name)
      : ImageReader(std::move(name)), stream_(std::move(stream)) {}
  ~PngReader() override { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  absl::Status Open(const ImageReadOptions& options) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, &OnError, &OnWarning);
    info_ = png_ == nullptr ? nullptr : png_create_info_struct(png_);
    if (info_ == nullptr) {
      return absl::ResourceExhaustedError(absl::StrCat(name_, ": out of memory"));
    }
    if (!ReadHeader(options.alpha)) {
      return error_;
    }
    const uint64_t image_bytes = static_cast<uint64_t>(header_.height) * RowBytes(header_);
    working_bytes_ = interlaced_ ? image_bytes : 0;
    return CheckLimits(width_, height_, options);
  }

 private:
  // libpng reports errors by longjmp: functions that it may leave that way keep no local with a destructor.
  bool ReadHeader(AlphaUse alpha) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    png_set_read_fn(png_, this, &OnRead);
    png_set_user_limits(png_, PNG_UINT_31_MAX, PNG_UINT_31_MAX);  // CheckLimits says it better
    png_set_chunk_malloc_max(png_, kMaxChunkBytes);
    png_set_chunk_cache_max(png_, kMaxCachedChunks);
    png_read_info(png_, info_);
    width_ = png_get_image_width(png_, info_);
    height_ = png_get_image_height(png_, info_);
    const int colour_type = png_get_color_type(png_, info_);
    const bool has_alpha =
        (colour_type & PNG_COLOR_MASK_ALPHA) != 0 || png_get_valid(png_, info_, PNG_INFO_tRNS) != 0;
    const bool keep_alpha = has_alpha && alpha == AlphaUse::kKeep;
    const bool colour = (colour_type & PNG_COLOR_MASK_COLOR) != 0;
    png_set_expand(png_);  // palettes and less than 8 bits to whole samples, transparency to alpha
    if (has_alpha && !keep_alpha) {
      png_set_strip_alpha(png_);
    }
    if (keep_alpha && !colour) {
      png_set_gray_to_rgb(png_);
    }
    if (std::endian::native == std::endian::little) {
      png_set_swap(png_);
    }
    interlaced_ = png_get_interlace_type(png_, info_) != PNG_INTERLACE_NONE;
    passes_ = png_set_interlace_handling(png_);
    header_.format = ImageFormat::kPng;
    header_.width = static_cast<int>(width_);
    header_.height = static_cast<int>(height_);
    header_.channels = keep_alpha ? 4 : colour ? 3 : 1;
    header_.type = png_get_bit_depth(png_, info_) == 16 ? SampleType::kU16 : SampleType::kU8;
    return true;
  }

  absl::Status ReadNextRows(int num_rows, std::span<std::byte> rows) override {
    if (interlaced_ && whole_.empty()) {
      whole_.resize(static_cast<size_t>(header_.height) * RowBytes(header_));
    }
    const bool ok = interlaced_ ? ReadInterlaced(num_rows, rows) : ReadPlain(num_rows, rows);
    return ok ? absl::OkStatus() : error_;
  }

  bool ReadPlain(int num_rows, std::span<std::byte> rows) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    Start();
    for (int i = 0; i < num_rows; ++i) {
      png_read_row(png_, reinterpret_cast<png_bytep>(rows.data() + i * RowBytes(header_)), nullptr);
    }
    if (next_row_ + num_rows == header_.height) {
      png_read_end(png_, nullptr);
    }
    return true;
  }

  bool ReadInterlaced(int num_rows, std::span<std::byte> rows) {
    if (setjmp(png_jmpbuf(png_)) != 0) {
      return false;
    }
    if (!started_) {
      Start();
      for (int pass = 0; pass < passes_; ++pass) {
        for (int y = 0; y < header_.height; ++y) {
          png_read_row(png_, reinterpret_cast<png_bytep>(whole_.data() + y * RowBytes(header_)), nullptr);
        }
      }
      png_read_end(png_, nullptr);
    }
    const auto begin = whole_.begin() + static_cast<ptrdiff_t>(next_row_ * RowBytes(header_));
    std::copy_n(begin, num_rows * RowBytes(header_), rows.begin());
    return true;
  }

  void Start() {
    if (!started_) {
      started_ = true;
      png_read_update_info(png_, info_);
      if (png_get_rowbytes(png_, info_) != RowBytes(header_)) {
        png_error(png_, "unexpected row size");
      }
    }
  }

  static void OnRead(png_structp png, png_bytep bytes, size_t count) {
    auto* self = static_cast<PngReader*>(png_get_io_ptr(png));
    if (!self->Fill(std::as_writable_bytes(std::span(bytes, count)))) {
      png_error(png, "stream");
    }
  }

  bool Fill(std::span<std::byte> bytes) {
    const absl::StatusOr<size_t> count = stream_->Read(bytes);
    if (!count.ok()) {
      error_ = absl::Status(count.status().code(), absl::StrCat(name_, ": ", count.status().message()));
    } else if (*count < bytes.size()) {
      error_ = absl::DataLossError(absl::StrCat(name_, ": truncated PNG"));
    }
    return error_.ok();
  }

  void Fail(const char* message) {
    if (error_.ok()) {
      error_ = absl::DataLossError(absl::StrCat(name_, ": damaged PNG: ", message));
    }
  }

  static void OnError(png_structp png, png_const_charp message) {
    static_cast<PngReader*>(png_get_error_ptr(png))->Fail(message);
    png_longjmp(png, 1);
  }
  static void OnWarning(png_structp /*png*/, png_const_charp /*message*/) {}

  std::unique_ptr<ByteStream> stream_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  absl::Status error_;
  uint32_t width_ = 0;
  uint32_t height_ = 0;
  bool interlaced_ = false;
  bool started_ = false;
  int passes_ = 1;
  std::vector<std::byte> whole_;  // of an interlaced image, whose rows come in passes
};

}  // namespace

absl::StatusOr<std::unique_ptr<ImageReader>> OpenPng(std::unique_ptr<ByteStream> stream, std::string name,
                                                     const ImageReadOptions& options) {
  auto reader = std::make_unique<PngReader>(std::move(stream), std::move(name));
  TESSERA_RETURN_IF_ERROR(reader->Open(options));
  return reader;
}

}  // namespace tessera
