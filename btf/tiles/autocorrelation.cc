#include "btf/tiles/autocorrelation.h"

#include <algorithm>
#include <array>
#include <complex>
#include <cstdlib>
#include <memory>

#include <kiss_fftnd.h>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

using FieldValue = std::complex<float>;
static_assert(sizeof(kiss_fft_cpx) == sizeof(FieldValue));

// The mean of dimension `dim` over each shrink x shrink pixels, about the mean of all.
std::vector<float> FieldChannel(const PointField& field, int dim, int shrink) {
  const int width = field.width / shrink;
  const int height = field.height / shrink;
  std::vector<float> values(static_cast<size_t>(width) * height, 0.0f);
  double sum = 0.0;
  for (int y = 0; y < height * shrink; ++y) {
    for (int x = 0; x < width * shrink; ++x) {
      const float value =
          field.points[static_cast<size_t>(y) * field.width + x][dim] / static_cast<float>(shrink * shrink);
      values[static_cast<size_t>(y / shrink) * width + x / shrink] += value;
      sum += value;
    }
  }
  const auto mean = static_cast<float>(sum / static_cast<double>(values.size()));
  for (float& value : values) {
    value -= mean;
  }
  return values;
}

}  // namespace

PointField FieldOfExemplar(const Exemplar& exemplar) {
  PointField field{exemplar.width(), exemplar.height(), {}};
  for (int pixel = 0; pixel < exemplar.num_pixels(); ++pixel) {
    field.points.push_back(exemplar.Point(static_cast<uint32_t>(pixel)));
  }
  return field;
}

absl::StatusOr<Autocorrelation> Autocorrelation::Of(const PointField& field, int dims, int shrink, int most_x,
                                                    int most_y, const RunContext& context) {
  const int width = field.width / shrink;
  const int height = field.height / shrink;
  // Padded, so that no shift looked at wraps around.
  const int padded_width = kiss_fft_next_fast_size(width + most_x);
  const int padded_height = kiss_fft_next_fast_size(height + most_y);
  const size_t padded = static_cast<size_t>(padded_width) * padded_height;
  const std::array<int, 2> extents = {padded_height, padded_width};
  using Plan = std::unique_ptr<kiss_fftnd_state, decltype(&free)>;
  const Plan forward(kiss_fftnd_alloc(extents.data(), 2, 0, nullptr, nullptr), &free);
  const Plan inverse(kiss_fftnd_alloc(extents.data(), 2, 1, nullptr, nullptr), &free);
  const auto transform = [](const Plan& plan, const std::vector<FieldValue>& in,
                            std::vector<FieldValue>& out) {
    kiss_fftnd(plan.get(), reinterpret_cast<const kiss_fft_cpx*>(in.data()),
               reinterpret_cast<kiss_fft_cpx*>(out.data()));
  };
  // Two dimensions a transform: the real part of the autocorrelation of x + i y is that of x and that of y.
  std::vector<FieldValue> power(padded);
  std::vector<FieldValue> plane(padded);
  std::vector<FieldValue> spectrum(padded);
  for (int dim = 0; dim < dims; dim += 2) {
    const std::vector<float> real = FieldChannel(field, dim, shrink);
    const std::vector<float> imaginary =
        dim + 1 < dims ? FieldChannel(field, dim + 1, shrink) : std::vector<float>(real.size(), 0.0f);
    std::ranges::fill(plane, FieldValue());
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const size_t index = static_cast<size_t>(y) * width + x;
        plane[static_cast<size_t>(y) * padded_width + x] = {real[index], imaginary[index]};
      }
    }
    transform(forward, plane, spectrum);
    for (size_t i = 0; i < padded; ++i) {
      power[i] += std::norm(spectrum[i]);
    }
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  transform(inverse, power, plane);
  const double at_rest = plane[0].real() / (static_cast<double>(width) * height);
  Autocorrelation result;
  result.most_x_ = most_x;
  result.most_y_ = most_y;
  for (int dy = 0; dy <= most_y; ++dy) {
    for (int dx = -most_x; dx <= most_x; ++dx) {
      const double overlap = static_cast<double>(width - std::abs(dx)) * (height - dy);
      const size_t column = dx < 0 ? padded_width + dx : dx;
      result.values_.push_back(at_rest > 0.0 ? plane[dy * static_cast<size_t>(padded_width) + column].real() /
                                                   overlap / at_rest
                                             : 0.0);
    }
  }
  return result;
}

}  // namespace tessera
