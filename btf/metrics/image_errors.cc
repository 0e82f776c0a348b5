#include "btf/metrics/image_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/image/transfer.h"
#include "btf/metrics/flip.h"
#include "btf/metrics/ssim.h"

namespace tessera {

absl::Status CheckComparable(const Image& reference, const Image& image) {
  const auto shape = [](const Image& i) { return absl::StrCat(i.width, "x", i.height, "x", i.channels); };
  const size_t expected =
      static_cast<size_t>(std::max(0, reference.width)) * std::max(0, reference.height) * 3;
  if (reference.channels != 3 || image.channels != 3 || image.width != reference.width ||
      image.height != reference.height || expected == 0 || reference.pixels.size() != expected ||
      image.pixels.size() != expected) {
    return absl::InvalidArgumentError(absl::StrCat("pictures of ", shape(reference), " and ", shape(image),
                                                   ": expected one shape with three channels"));
  }
  return absl::OkStatus();
}

absl::Status ImageErrors::Add(const Image& reference, const Image& image) {
  TESSERA_RETURN_IF_ERROR(CheckComparable(reference, image));
  const Image coded_reference = SrgbCoded(reference);
  const Image coded = SrgbCoded(image);
  for (size_t i = 0; i < reference.pixels.size(); ++i) {
    const double value = reference.pixels[i];
    const double difference = image.pixels[i] - value;
    const double coded_difference = double{coded.pixels[i]} - coded_reference.pixels[i];
    squares_ += difference * difference;
    reference_squares_ += value * value;
    coded_squares_ += coded_difference * coded_difference;
  }
  dssim_ += Dssim(coded_reference, coded);
  flip_ += Flip(reference, image);
  num_samples_ += static_cast<int64_t>(reference.pixels.size());
  ++num_images_;
  return absl::OkStatus();
}

void ImageErrors::Add(const ImageErrors& other) {
  num_images_ += other.num_images_;
  num_samples_ += other.num_samples_;
  squares_ += other.squares_;
  reference_squares_ += other.reference_squares_;
  coded_squares_ += other.coded_squares_;
  dssim_ += other.dssim_;
  flip_ += other.flip_;
}

double ImageErrors::rmse() const {
  return num_samples_ == 0 ? 0.0 : std::sqrt(squares_ / static_cast<double>(num_samples_));
}

double ImageErrors::relative_rmse() const {
  return squares_ == 0.0 ? 0.0 : std::sqrt(squares_ / reference_squares_);
}

double ImageErrors::psnr_db() const {
  return coded_squares_ == 0.0 ? std::numeric_limits<double>::infinity()
                               : -10.0 * std::log10(coded_squares_ / static_cast<double>(num_samples_));
}

double ImageErrors::dssim() const {
  return num_images_ == 0 ? 0.0 : dssim_ / static_cast<double>(num_images_);
}

double ImageErrors::flip() const {
  return num_images_ == 0 ? 0.0 : flip_ / static_cast<double>(num_images_);
}

}  // namespace tessera
