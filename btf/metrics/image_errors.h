// Errors of decoded pictures, summed over many of them.
//
//   ImageErrors errors;
//   TESSERA_RETURN_IF_ERROR(errors.Add(reference, decoded));   // once a picture
//   errors.relative_rmse(); errors.flip();
#pragma once

#include <cstdint>

#include <absl/status/status.h>

#include "btf/image/image.h"

namespace tessera {

// Errors: INVALID_ARGUMENT naming both shapes; three channels and at least one pixel are expected.
[[nodiscard]] absl::Status CheckComparable(const Image& reference, const Image& image);

// RMSE, relative RMSE and PSNR pool squares over all pictures (a PSNR of the whole, not a mean of PSNRs);
// DSSIM and FLIP are means over pictures. Pictures are linear RGB. All are 0, PSNR infinite, before the first
// picture.
class ImageErrors {
 public:
  // Errors: those of CheckComparable.
  [[nodiscard]] absl::Status Add(const Image& reference, const Image& image);
  // Joins the sums of other pictures. Sums are doubles: join in a fixed order for fixed bits.
  void Add(const ImageErrors& other);

  [[nodiscard]] int64_t num_images() const { return num_images_; }
  // Of linear values.
  [[nodiscard]] double rmse() const;
  // rmse() over the root mean square of the references; 0 where those are black and met, else infinite.
  [[nodiscard]] double relative_rmse() const;
  // dB, of sRGB-coded values clamped to [0, 1], peak 1.
  [[nodiscard]] double psnr_db() const;
  // In [0, 1]: see ssim.h.
  [[nodiscard]] double dssim() const;
  // In [0, 1]: see flip.h, at kFlipPixelsPerDegree.
  [[nodiscard]] double flip() const;

 private:
  int64_t num_images_ = 0;
  int64_t num_samples_ = 0;
  double squares_ = 0.0;
  double reference_squares_ = 0.0;
  double coded_squares_ = 0.0;
  double dssim_ = 0.0;
  double flip_ = 0.0;
};

}  // namespace tessera
