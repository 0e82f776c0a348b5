#include "btf/image/jpeg_writer.h"

#include <array>
#include <csetjmp>
#include <cstdio>
#include <cstdlib>

#include <absl/strings/str_cat.h>
#include <jpeglib.h>

#include "btf/image/image_io.h"

namespace tessera {
namespace {

struct JpegErrors {
  jpeg_error_mgr manager;
  std::jmp_buf jump;
  std::array<char, JMSG_LENGTH_MAX> message{};
};

struct JpegBytes {
  unsigned char* data = nullptr;
  unsigned long size = 0;
};

// longjmp leaves this function only past locals without destructors.
bool WriteJpeg(const uint8_t* rgb, int width, int height, int quality, JpegErrors& errors, JpegBytes& bytes) {
  jpeg_compress_struct state;
  state.err = jpeg_std_error(&errors.manager);
  errors.manager.error_exit = [](j_common_ptr failed) {
    auto* errors = reinterpret_cast<JpegErrors*>(failed->err);
    failed->err->format_message(failed, errors->message.data());
    std::longjmp(errors->jump, 1);
  };
  errors.manager.output_message = [](j_common_ptr) {};
  if (setjmp(errors.jump) != 0) {
    jpeg_destroy_compress(&state);
    return false;
  }
  jpeg_create_compress(&state);
  jpeg_mem_dest(&state, &bytes.data, &bytes.size);
  state.image_width = static_cast<JDIMENSION>(width);
  state.image_height = static_cast<JDIMENSION>(height);
  state.input_components = 3;
  state.in_color_space = JCS_RGB;
  jpeg_set_defaults(&state);
  jpeg_set_quality(&state, quality, TRUE);
  state.optimize_coding = TRUE;
  state.dct_method = JDCT_ISLOW;
  jpeg_start_compress(&state, TRUE);
  while (state.next_scanline < state.image_height) {
    // libjpeg takes rows without const, and only reads them.
    auto* row = const_cast<uint8_t*>(rgb) + static_cast<size_t>(state.next_scanline) * width * 3;
    jpeg_write_scanlines(&state, &row, 1);
  }
  jpeg_finish_compress(&state);
  jpeg_destroy_compress(&state);
  return true;
}

}  // namespace

absl::StatusOr<std::string> EncodeJpeg(std::span<const uint8_t> rgb, int width, int height, int quality) {
  if (width < 1 || height < 1 || width > kMaxImageSide || height > kMaxImageSide ||
      rgb.size() != static_cast<size_t>(width) * height * 3) {
    return absl::InvalidArgumentError(
        absl::StrCat("JPEG of ", width, "x", height, " from ", rgb.size(), " codes"));
  }
  if (quality < 1 || quality > 100) {
    return absl::InvalidArgumentError(absl::StrCat("JPEG quality ", quality, ", expected 1 to 100"));
  }
  JpegErrors errors;
  JpegBytes bytes;
  const bool written = WriteJpeg(rgb.data(), width, height, quality, errors, bytes);
  absl::StatusOr<std::string> result =
      written ? absl::StatusOr<std::string>(std::string(reinterpret_cast<char*>(bytes.data), bytes.size))
              : absl::InternalError(absl::StrCat("libjpeg: ", errors.message.data()));
  std::free(bytes.data);
  return result;
}

}  // namespace tessera
