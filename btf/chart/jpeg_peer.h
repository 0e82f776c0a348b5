// What one would do without any of this: every image as a JPEG file. Its bytes are those of all files, its
// random access decodes a whole file, and at directions without an image the nearest one is shown.
//
//   TESSERA_ASSIGN_OR_RETURN(JpegPeer jpeg, JpegPeer::Create(source, 4, context));
//   TESSERA_ASSIGN_OR_RETURN(JpegSet set, jpeg.Encode(/*quality=*/75, context));
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/data/btf_source.h"
#include "btf/image/image.h"
#include "btf/measure/held_out.h"

namespace tessera {

// All images at one quality.
struct JpegSet {
  int quality = 0;  // 1 to 100, as libjpeg counts
  uint64_t size_bytes = 0;
  double encode_s = 0.0;      // of all, wall clock
  double encode_cpu_s = 0.0;  // of all threads
  double decode_s = 0.0;      // processor time to decode one image, the mean over some
  // sRGB codes of every row_stride-th row of every decoded image, [view][light][row][x][3].
  std::vector<uint8_t> rows;
};

class JpegPeer {
 public:
  // Holds all images as sRGB codes of 8 bits, clamped to [0, 1]: one byte a sample. Reads the source once.
  // Errors: those of the source; CANCELLED.
  [[nodiscard]] static absl::StatusOr<JpegPeer> Create(BtfSource& source, int row_stride,
                                                       const RunContext& context);

  // Errors: EncodeJpeg's and DecodeImage's; CANCELLED.
  [[nodiscard]] absl::StatusOr<JpegSet> Encode(int quality, const RunContext& context) const;

  // The largest quality whose files take at most `size_bytes`, by bisection; 1 where even that takes more.
  // Errors: as Encode.
  [[nodiscard]] absl::StatusOr<int> QualityFor(uint64_t size_bytes, const RunContext& context) const;

  // The measured image shown for a view and a light when those that `split` holds out have none: the kept
  // direction at the least angle, the first of equals.
  [[nodiscard]] size_t ShownImage(Split split, int view, int light) const;
  // Linear values of a row kept in `set`, `y` a multiple of row_stride.
  void Row(const JpegSet& set, Split split, int y, int view, int light, std::span<float> rgb) const;
  // The whole decoded image. Errors: as Encode.
  [[nodiscard]] absl::StatusOr<Image> Picture(int quality, Split split, int view, int light) const;

 private:
  JpegPeer() = default;

  int width_ = 0;
  int height_ = 0;
  int row_stride_ = 1;
  size_t num_images_ = 0;
  size_t num_lights_ = 0;
  std::vector<uint8_t> codes_;           // [view][light][y][x][3]
  std::vector<int> nearest_kept_view_;   // [view]
  std::vector<int> nearest_kept_light_;  // [light]
};

}  // namespace tessera
