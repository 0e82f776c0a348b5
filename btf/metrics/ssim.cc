#include "btf/metrics/ssim.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Core>

#include "btf/image/transfer.h"

namespace tessera {
namespace {

constexpr int kWindow = 11;
constexpr double kSigma = 1.5;
constexpr float kC1 = 0.01F * 0.01F;
constexpr float kC2 = 0.03F * 0.03F;

using Plane = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::vector<float> GaussianWindow(int size) {
  std::vector<double> weights(size);
  double sum = 0.0;
  for (int i = 0; i < size; ++i) {
    const double x = i - 0.5 * (size - 1);
    weights[i] = std::exp(-x * x / (2.0 * kSigma * kSigma));
    sum += weights[i];
  }
  std::vector<float> window(size);
  std::ranges::transform(weights, window.begin(), [sum](double w) { return static_cast<float>(w / sum); });
  return window;
}

// The weighted mean over each window that lies inside.
Plane WindowMeans(const Plane& plane, const std::vector<float>& across, const std::vector<float>& down) {
  const auto columns = plane.cols() - static_cast<Eigen::Index>(across.size()) + 1;
  const auto rows = plane.rows() - static_cast<Eigen::Index>(down.size()) + 1;
  Plane half = Plane::Zero(plane.rows(), columns);
  for (size_t i = 0; i < across.size(); ++i) {
    half += across[i] * plane.middleCols(static_cast<Eigen::Index>(i), columns);
  }
  Plane means = Plane::Zero(rows, columns);
  for (size_t i = 0; i < down.size(); ++i) {
    means += down[i] * half.middleRows(static_cast<Eigen::Index>(i), rows);
  }
  return means;
}

Plane ChannelOf(const Image& image, int channel) {
  Plane plane(image.height, image.width);
  for (Eigen::Index i = 0; i < plane.size(); ++i) {
    plane.data()[i] = image.pixels[static_cast<size_t>(i) * 3 + channel];
  }
  return plane;
}

}  // namespace

Image SrgbCoded(const Image& linear) {
  // Pictures are compared by the million pixels: one table look-up with linear interpolation, exact to 1e-5
  // (the curve is nearly straight between entries), instead of a power.
  constexpr int kEntries = 1 << 14;
  static const std::vector<float> table = [] {
    std::vector<float> values(kEntries + 2);
    for (int i = 0; i <= kEntries + 1; ++i) {
      values[i] = static_cast<float>(SrgbFromLinear(static_cast<double>(i) / kEntries));
    }
    return values;
  }();
  Image coded = linear;
  for (float& value : coded.pixels) {
    // Also false for not-a-number.
    const float scaled = value > 0.0F ? std::min(value, 1.0F) * kEntries : 0.0F;
    const int index = static_cast<int>(scaled);
    value = std::min(1.0F,
                     table[index] + (scaled - static_cast<float>(index)) * (table[index + 1] - table[index]));
  }
  return coded;
}

double Ssim(const Image& reference, const Image& image) {
  const std::vector<float> across = GaussianWindow(std::min(kWindow, reference.width));
  const std::vector<float> down = GaussianWindow(std::min(kWindow, reference.height));
  double sum = 0.0;
  for (int channel = 0; channel < 3; ++channel) {
    const Plane a = ChannelOf(reference, channel);
    const Plane b = ChannelOf(image, channel);
    const Plane mean_a = WindowMeans(a, across, down);
    const Plane mean_b = WindowMeans(b, across, down);
    const Plane variance_a = WindowMeans(a.square(), across, down) - mean_a.square();
    const Plane variance_b = WindowMeans(b.square(), across, down) - mean_b.square();
    const Plane covariance = WindowMeans(a * b, across, down) - mean_a * mean_b;
    const Plane ssim = (2.0F * mean_a * mean_b + kC1) * (2.0F * covariance + kC2) /
                       ((mean_a.square() + mean_b.square() + kC1) * (variance_a + variance_b + kC2));
    sum += ssim.cast<double>().mean();
  }
  return sum / 3.0;
}

double Dssim(const Image& reference, const Image& image) {
  return 0.5 * (1.0 - Ssim(reference, image));
}

}  // namespace tessera
