#include "btf/metrics/flip.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Core>
#include <Eigen/LU>

namespace tessera {
namespace {

using Plane = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Planes = std::array<Plane, 3>;
using Matrix = Eigen::Matrix3d;
constexpr double kPiValue = 3.14159265358979323846;

// Exponents and knee of the two pipelines.
constexpr double kColourExponent = 0.7;     // q_c
constexpr double kKneeShare = 0.4;          // p_c, of the largest colour difference
constexpr double kKneeValue = 0.95;         // p_t
constexpr double kFeatureExponent = 0.5;    // q_f
constexpr double kFeatureWidthDeg = 0.082;  // w, peak to trough

// Contrast sensitivity as sums of two Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees.
struct Sensitivity {
  double a1, b1, a2, b2;
};
constexpr std::array<Sensitivity, 3> kSensitivity = {
    {{1.0, 0.0047, 0.0, 1e-5}, {1.0, 0.0053, 0.0, 1e-5}, {34.1, 0.04, 13.5, 0.025}}};
constexpr double kWidestB = 0.04;

// Linear sRGB to XYZ with D65, IEC 61966-2-1.
const Matrix& XyzFromRgb() {
  static const Matrix matrix = (Matrix() << 0.4123907993, 0.3575843394, 0.1804807884, 0.2126390059,
                                0.7151686788, 0.0721923154, 0.0193308187, 0.1191947798, 0.9505321522)
                                   .finished();
  return matrix;
}

Eigen::Vector3d WhiteXyz() {
  return XyzFromRgb() * Eigen::Vector3d::Ones();
}

// XYZ of the white = 1, so that Y - X and the like vanish for grays.
Matrix NormalisedXyzFromRgb() {
  return WhiteXyz().cwiseInverse().asDiagonal() * XyzFromRgb();
}

// YCxCz = 116 Y - 16, 500 (X - Y), 200 (Y - Z): linear but for the constant.
Matrix OpponentFromRgb() {
  Matrix opponent_from_xyz;
  opponent_from_xyz << 0, 116, 0, 500, -500, 0, 0, 200, -200;
  return opponent_from_xyz * NormalisedXyzFromRgb();
}

float LabCurve(float t) {
  constexpr float kDelta = 6.0F / 29.0F;
  return t > kDelta * kDelta * kDelta ? std::cbrt(t) : t / (3.0F * kDelta * kDelta) + 4.0F / 29.0F;
}

// L*, and a* and b* times 0.01 L* (Hunt: colours look stronger in the light).
Eigen::Vector3f HuntLab(const Eigen::Vector3f& rgb) {
  static const Eigen::Matrix3f xyz_from_rgb = NormalisedXyzFromRgb().cast<float>();
  const Eigen::Vector3f xyz = xyz_from_rgb * rgb;
  const float x = LabCurve(xyz.x());
  const float y = LabCurve(xyz.y());
  const float z = LabCurve(xyz.z());
  const float lightness = 116.0F * y - 16.0F;
  return {lightness, 5.0F * lightness * (x - y), 2.0F * lightness * (y - z)};
}

float HyAb(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return std::abs(a.x() - b.x()) + std::hypot(a.y() - b.y(), a.z() - b.z());
}

// Weights of taps -radius..radius along one axis.
using Kernel = std::vector<float>;

template <typename Function>
Kernel MakeKernel(int radius, Function function) {
  Kernel kernel;
  for (int i = -radius; i <= radius; ++i) {
    kernel.push_back(static_cast<float>(function(i)));
  }
  return kernel;
}

enum class Axis { kColumns, kRows };

// Borders repeat.
Plane Convolve(const Plane& plane, const Kernel& kernel, Axis axis) {
  const int radius = static_cast<int>(kernel.size() / 2);
  const bool across = axis == Axis::kColumns;
  const Eigen::Index length = across ? plane.cols() : plane.rows();
  Plane padded(plane.rows() + (across ? 0 : 2 * radius), plane.cols() + (across ? 2 * radius : 0));
  for (Eigen::Index i = 0; i < length + 2 * radius; ++i) {
    const Eigen::Index from = std::clamp<Eigen::Index>(i - radius, 0, length - 1);
    if (across) {
      padded.col(i) = plane.col(from);
    } else {
      padded.row(i) = plane.row(from);
    }
  }
  Plane result = Plane::Zero(plane.rows(), plane.cols());
  for (size_t tap = 0; tap < kernel.size(); ++tap) {
    const auto begin = static_cast<Eigen::Index>(tap);
    if (across) {
      result += kernel[tap] * padded.middleCols(begin, length);
    } else {
      result += kernel[tap] * padded.middleRows(begin, length);
    }
  }
  return result;
}

// The 2-D filter of one channel: each Gaussian is separable, and the whole sums to 1 over its square.
Plane FilterBySensitivity(const Plane& plane, const Sensitivity& s, double pixels_per_degree) {
  const int radius = static_cast<int>(
      std::ceil(3.0 * std::sqrt(kWidestB / (2.0 * kPiValue * kPiValue)) * pixels_per_degree));
  const std::array<std::array<double, 2>, 2> terms = {{{s.a1, s.b1}, {s.a2, s.b2}}};
  std::vector<Plane> filtered;
  std::vector<double> shares;
  double total = 0.0;
  for (const auto& [a, b] : terms) {
    if (a == 0.0) {
      continue;
    }
    Kernel kernel = MakeKernel(radius, [&, b = b](int i) {
      const double x = i / pixels_per_degree;
      return std::exp(-kPiValue * kPiValue * x * x / b);
    });
    double sum = 0.0;
    for (const float weight : kernel) {
      sum += weight;
    }
    for (float& weight : kernel) {
      weight = static_cast<float>(weight / sum);
    }
    shares.push_back(a * std::sqrt(kPiValue / b) * sum * sum);
    total += shares.back();
    filtered.push_back(Convolve(Convolve(plane, kernel, Axis::kColumns), kernel, Axis::kRows));
  }
  Plane result = Plane::Zero(plane.rows(), plane.cols());
  for (size_t i = 0; i < filtered.size(); ++i) {
    result += static_cast<float>(shares[i] / total) * filtered[i];
  }
  return result;
}

Planes OpponentPlanes(const Image& image) {
  static const Eigen::Matrix3f opponent_from_rgb = OpponentFromRgb().cast<float>();
  Planes planes;
  for (Plane& plane : planes) {
    plane.resize(image.height, image.width);
  }
  for (Eigen::Index i = 0; i < planes[0].size(); ++i) {
    const Eigen::Vector3f rgb =
        Eigen::Map<const Eigen::Vector3f>(image.pixels.data() + 3 * i).cwiseMax(0.0F).cwiseMin(1.0F);
    const Eigen::Vector3f opponent = opponent_from_rgb * rgb;
    for (int channel = 0; channel < 3; ++channel) {
      planes[channel].data()[i] = opponent[channel] - (channel == 0 ? 16.0F : 0.0F);
    }
  }
  return planes;
}

// What the eye sees of the picture, ready for the colour distance.
std::vector<Eigen::Vector3f> Perceived(const Planes& opponent, double pixels_per_degree) {
  static const Eigen::Matrix3f rgb_from_opponent = OpponentFromRgb().inverse().cast<float>();
  Planes filtered;
  for (int channel = 0; channel < 3; ++channel) {
    filtered[channel] = FilterBySensitivity(opponent[channel], kSensitivity[channel], pixels_per_degree);
  }
  std::vector<Eigen::Vector3f> lab(filtered[0].size());
  for (size_t i = 0; i < lab.size(); ++i) {
    const Eigen::Vector3f seen(filtered[0].data()[i] + 16.0F, filtered[1].data()[i], filtered[2].data()[i]);
    lab[i] = HuntLab((rgb_from_opponent * seen).cwiseMax(0.0F).cwiseMin(1.0F));
  }
  return lab;
}

// Positive weights sum to 1, negative ones to -1: differences of two weighted means.
Kernel Balanced(Kernel kernel) {
  double positive = 0.0;
  double negative = 0.0;
  for (const float weight : kernel) {
    (weight > 0.0F ? positive : negative) += weight;
  }
  for (float& weight : kernel) {
    weight = static_cast<float>(weight > 0.0F ? weight / positive : -weight / negative);
  }
  return kernel;
}

struct Features {
  Plane edges;
  Plane points;
};

Features FeaturesOf(const Plane& lightness, double pixels_per_degree) {
  const double sigma = 0.5 * kFeatureWidthDeg * pixels_per_degree;
  const int radius = static_cast<int>(std::ceil(3.0 * sigma));
  const auto gauss = [sigma](int i) { return std::exp(-i * i / (2.0 * sigma * sigma)); };
  Kernel smooth = MakeKernel(radius, gauss);
  double sum = 0.0;
  for (const float weight : smooth) {
    sum += weight;
  }
  for (float& weight : smooth) {
    weight = static_cast<float>(weight / sum);
  }
  const Kernel first = Balanced(MakeKernel(radius, [&](int i) { return -i * gauss(i); }));
  const Kernel second =
      Balanced(MakeKernel(radius, [&](int i) { return (i * i / (sigma * sigma) - 1.0) * gauss(i); }));
  // Y of YCxCz to [0, 1].
  const Plane luminance = (lightness + 16.0F) / 116.0F;
  const Plane smooth_rows = Convolve(luminance, smooth, Axis::kRows);
  const Plane smooth_columns = Convolve(luminance, smooth, Axis::kColumns);
  const auto magnitude = [&](const Kernel& kernel) -> Plane {
    return (Convolve(smooth_rows, kernel, Axis::kColumns).square() +
            Convolve(smooth_columns, kernel, Axis::kRows).square())
        .sqrt();
  };
  return {magnitude(first), magnitude(second)};
}

// The distance of the two colours farthest apart, green and blue, with the exponent.
float LargestColourDifference() {
  static const float largest = std::pow(HyAb(HuntLab({0.0F, 1.0F, 0.0F}), HuntLab({0.0F, 0.0F, 1.0F})),
                                        static_cast<float>(kColourExponent));
  return largest;
}

float Redistributed(float difference) {
  const float largest = LargestColourDifference();
  const float knee = static_cast<float>(kKneeShare) * largest;
  constexpr auto kAtKnee = static_cast<float>(kKneeValue);
  return difference < knee ? difference * kAtKnee / knee
                           : kAtKnee + (difference - knee) / (largest - knee) * (1.0F - kAtKnee);
}

}  // namespace

Image FlipMap(const Image& reference, const Image& image, double pixels_per_degree) {
  const Planes opponent_a = OpponentPlanes(reference);
  const Planes opponent_b = OpponentPlanes(image);
  const std::vector<Eigen::Vector3f> seen_a = Perceived(opponent_a, pixels_per_degree);
  const std::vector<Eigen::Vector3f> seen_b = Perceived(opponent_b, pixels_per_degree);
  const Features a = FeaturesOf(opponent_a[0], pixels_per_degree);
  const Features b = FeaturesOf(opponent_b[0], pixels_per_degree);
  Image map(reference.width, reference.height, 1);
  for (size_t i = 0; i < map.pixels.size(); ++i) {
    const float colour =
        Redistributed(std::pow(HyAb(seen_a[i], seen_b[i]), static_cast<float>(kColourExponent)));
    const float feature = std::max(std::abs(a.edges.data()[i] - b.edges.data()[i]),
                                   std::abs(a.points.data()[i] - b.points.data()[i]));
    const float feature_share =
        std::clamp(std::pow(feature / std::sqrt(2.0F), static_cast<float>(kFeatureExponent)), 0.0F, 1.0F);
    map.pixels[i] = std::clamp(std::pow(colour, 1.0F - feature_share), 0.0F, 1.0F);
  }
  return map;
}

double Flip(const Image& reference, const Image& image, double pixels_per_degree) {
  const Image map = FlipMap(reference, image, pixels_per_degree);
  double sum = 0.0;
  for (const float value : map.pixels) {
    sum += value;
  }
  return sum / static_cast<double>(map.pixels.size());
}

}  // namespace tessera
