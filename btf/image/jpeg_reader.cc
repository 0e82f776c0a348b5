#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <utility>

#include <absl/strings/str_cat.h>
#include <jpeglib.h>
// After jpeglib.h, which it needs.
#include <jerror.h>

#include "btf/base/status_macros.h"
#include "btf/image/format_readers.h"
#include "btf/image/image_io.h"

namespace tessera {

namespace {

constexpr size_t kBufferBytes = 16 << 10;
// A progressive file costs a pass over the image per scan; real ones have about ten.
constexpr int kMaxScans = 200;

class JpegReader : public ImageReader {
 public:
  JpegReader(std::unique_ptr<ByteStream> stream, std::string name)
      : ImageReader(std::move(name)), stream_(std::move(stream)) {
    state_.err = jpeg_std_error(&errors_);
    errors_.error_exit = &OnError;
    errors_.emit_message = &OnMessage;
    errors_.output_message = [](j_common_ptr) {};
    source_.init_source = [](j_decompress_ptr) {};
    source_.fill_input_buffer = &OnFill;
    source_.skip_input_data = &OnSkip;
    source_.resync_to_restart = &jpeg_resync_to_restart;
    source_.term_source = [](j_decompress_ptr) {};
    source_.next_input_byte = nullptr;
    source_.bytes_in_buffer = 0;
    progress_.progress_monitor = &OnProgress;
  }
  ~JpegReader() override {
    if (created_) {
      jpeg_destroy_decompress(&state_);
    }
  }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  absl::Status Open(const ImageReadOptions& options) {
    if (!ReadHeader(options.memory_limit_bytes)) {
      return error_;
    }
    if (state_.jpeg_color_space == JCS_CMYK || state_.jpeg_color_space == JCS_YCCK) {
      return absl::InvalidArgumentError(
          absl::StrCat(name_, ": CMYK JPEG; only gray and RGB or YCbCr are read"));
    }
    if (state_.num_components != 1 && state_.num_components != 3) {
      return absl::InvalidArgumentError(
          absl::StrCat(name_, ": JPEG with ", state_.num_components, " components, expected 1 or 3"));
    }
    header_.format = ImageFormat::kJpeg;
    header_.width = static_cast<int>(state_.image_width);
    header_.height = static_cast<int>(state_.image_height);
    header_.channels = state_.num_components;
    header_.type = SampleType::kU8;
    // Images of several scans are kept as 16-bit coefficients, padded to whole blocks of up to 4 x 4.
    working_bytes_ = jpeg_has_multiple_scans(&state_) != 0
                         ? 2 * (uint64_t{state_.image_width} + 32) * (uint64_t{state_.image_height} + 32) *
                               state_.num_components
                         : 0;
    return CheckLimits(state_.image_width, state_.image_height, options);
  }

 private:
  // libjpeg reports errors by longjmp: functions that it may leave that way keep no local with a destructor.
  bool ReadHeader(uint64_t memory_limit_bytes) {
    if (setjmp(jump_) != 0) {
      return false;
    }
    jpeg_create_decompress(&state_);
    created_ = true;
    state_.client_data = this;
    state_.src = &source_;
    state_.mem->max_memory_to_use =
        static_cast<long>(std::min<uint64_t>(memory_limit_bytes, uint64_t{1} << 40));
    jpeg_read_header(&state_, TRUE);
    return true;
  }

  absl::Status ReadNextRows(int num_rows, std::span<std::byte> rows) override {
    if (!ReadScanlines(num_rows, rows)) {
      return error_;
    }
    if (next_row_ + num_rows < header_.height) {
      return absl::OkStatus();
    }
    // JPEG has no checksum of its own.
    const absl::Status status = stream_->Finish();
    return status.ok() ? status : absl::Status(status.code(), absl::StrCat(name_, ": ", status.message()));
  }

  bool ReadScanlines(int num_rows, std::span<std::byte> rows) {
    if (setjmp(jump_) != 0) {
      return false;
    }
    if (!started_) {
      started_ = true;
      state_.progress = &progress_;
      state_.out_color_space = header_.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
      state_.dct_method = JDCT_ISLOW;  // the accurate one: same samples on every machine
      jpeg_start_decompress(&state_);
    }
    int done = 0;
    while (done < num_rows) {
      std::array<JSAMPROW, 4> pointers;
      const int count = std::min<int>(pointers.size(), num_rows - done);
      for (int i = 0; i < count; ++i) {
        pointers[i] = reinterpret_cast<JSAMPROW>(rows.data() + (done + i) * RowBytes(header_));
      }
      done += static_cast<int>(jpeg_read_scanlines(&state_, pointers.data(), count));
    }
    if (next_row_ + num_rows == header_.height) {
      jpeg_finish_decompress(&state_);
    }
    return true;
  }

  static JpegReader* Self(void* state) {
    return static_cast<JpegReader*>(static_cast<j_common_ptr>(state)->client_data);
  }

  // Sets the error unless there is one already.
  void Fail(absl::Status status) {
    if (error_.ok()) {
      error_ = std::move(status);
    }
  }

  void FailWithMessage(j_common_ptr state) {
    std::array<char, JMSG_LENGTH_MAX> text{};
    state->err->format_message(state, text.data());
    Fail(absl::DataLossError(absl::StrCat(name_, ": damaged JPEG: ", text.data())));
  }

  static void OnError(j_common_ptr state) {
    JpegReader* self = Self(state);
    self->FailWithMessage(state);
    std::longjmp(self->jump_, 1);
  }

  // Damage to the coded data is only a warning to libjpeg, which goes on with gray blocks.
  static void OnMessage(j_common_ptr state, int level) {
    const int code = state->err->msg_code;
    if (level < 0 &&
        (code == JWRN_HIT_MARKER || code == JWRN_HUFF_BAD_CODE || code == JWRN_JPEG_EOF ||
         code == JWRN_MUST_RESYNC || code == JWRN_ARITH_BAD_CODE || code == JWRN_BOGUS_PROGRESSION)) {
      OnError(state);
    }
  }

  static void OnProgress(j_common_ptr state) {
    auto* decompress = reinterpret_cast<j_decompress_ptr>(state);
    if (decompress->input_scan_number > kMaxScans) {
      JpegReader* self = Self(state);
      self->Fail(absl::InvalidArgumentError(
          absl::StrCat(self->name_, ": JPEG with more than ", kMaxScans, " scans")));
      std::longjmp(self->jump_, 1);
    }
  }

  bool Refill() {
    const absl::StatusOr<size_t> count = stream_->Read(buffer_);
    if (!count.ok()) {
      Fail(absl::Status(count.status().code(), absl::StrCat(name_, ": ", count.status().message())));
      return false;
    }
    if (*count == 0) {
      Fail(absl::DataLossError(absl::StrCat(name_, ": truncated JPEG")));
      return false;
    }
    source_.next_input_byte = reinterpret_cast<const JOCTET*>(buffer_.data());
    source_.bytes_in_buffer = *count;
    return true;
  }

  static boolean OnFill(j_decompress_ptr state) {
    JpegReader* self = Self(state);
    if (!self->Refill()) {
      std::longjmp(self->jump_, 1);
    }
    return TRUE;
  }

  static void OnSkip(j_decompress_ptr state, long count) {
    JpegReader* self = Self(state);
    while (count > static_cast<long>(self->source_.bytes_in_buffer)) {
      count -= static_cast<long>(self->source_.bytes_in_buffer);
      OnFill(state);
    }
    if (count > 0) {
      self->source_.next_input_byte += count;
      self->source_.bytes_in_buffer -= static_cast<size_t>(count);
    }
  }

  std::unique_ptr<ByteStream> stream_;
  jpeg_decompress_struct state_{};
  jpeg_error_mgr errors_{};
  jpeg_source_mgr source_{};
  jpeg_progress_mgr progress_{};
  std::jmp_buf jump_;
  absl::Status error_;
  bool created_ = false;
  bool started_ = false;
  std::array<std::byte, kBufferBytes> buffer_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<ImageReader>> OpenJpeg(std::unique_ptr<ByteStream> stream, std::string name,
                                                      const ImageReadOptions& options) {
  auto reader = std::make_unique<JpegReader>(std::move(stream), std::move(name));
  TESSERA_RETURN_IF_ERROR(reader->Open(options));
  return reader;
}

}  // namespace tessera
