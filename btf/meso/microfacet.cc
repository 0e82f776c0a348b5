#include "btf/meso/microfacet.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "btf/math/conventions.h"

namespace tessera {
namespace {

constexpr int kMuNodes = 64;
constexpr int kRoughnessNodes = 24;
constexpr int kTableSamples = 512;

double RadicalInverse2(uint32_t bits) {
  double value = 0.0;
  for (double digit = 0.5; bits != 0; bits >>= 1, digit *= 0.5) {
    value += (bits & 1U) != 0 ? digit : 0.0;
  }
  return value;
}

double SmithLambda(double mu, double alpha) {
  const double tan2 = std::max(0.0, 1.0 - mu * mu) / (mu * mu);
  return 0.5 * (std::sqrt(1.0 + alpha * alpha * tan2) - 1.0);
}

// A normal visible from `wo`, with density G1 max(0, wo.h) D / n.wo; the estimate of the lobe's albedo is
// then F G2 / G1. [Heitz2018], "Sampling the GGX distribution of visible normals", listing 1.
Eigen::Vector3d SampleVisibleNormal(const Eigen::Vector3d& wo, double alpha, double u, double v) {
  const Eigen::Vector3d stretched = Eigen::Vector3d(alpha * wo.x(), alpha * wo.y(), wo.z()).normalized();
  const double length2 = stretched.x() * stretched.x() + stretched.y() * stretched.y();
  const Eigen::Vector3d t1 =
      length2 > 0.0
          ? Eigen::Vector3d(Eigen::Vector3d(-stretched.y(), stretched.x(), 0.0) / std::sqrt(length2))
          : Eigen::Vector3d(1.0, 0.0, 0.0);
  const Eigen::Vector3d t2 = stretched.cross(t1);
  const double r = std::sqrt(u);
  const double phi = 2.0 * kPi * v;
  const double a = r * std::cos(phi);
  const double s = 0.5 * (1.0 + stretched.z());
  const double b = (1.0 - s) * std::sqrt(std::max(0.0, 1.0 - a * a)) + s * r * std::sin(phi);
  const Eigen::Vector3d h = a * t1 + b * t2 + std::sqrt(std::max(0.0, 1.0 - a * a - b * b)) * stretched;
  return Eigen::Vector3d(alpha * h.x(), alpha * h.y(), std::max(1e-6, h.z())).normalized();
}

}  // namespace

float GgxAlpha(float roughness) {
  const float clamped = std::clamp(roughness, kMinRoughness, 1.0F);
  return clamped * clamped;
}

SpecularAlbedo::SpecularAlbedo()
    : directional_(static_cast<size_t>(kRoughnessNodes) * kMuNodes), average_(kRoughnessNodes) {
  constexpr double kGrazingMu =
      1e-3;  // the node for mu = 0, where the estimate has no limit in floating point
  for (int r = 0; r < kRoughnessNodes; ++r) {
    const double alpha = GgxAlpha(static_cast<float>(r) / (kRoughnessNodes - 1));
    for (int m = 0; m < kMuNodes; ++m) {
      const double mu = std::max(kGrazingMu, static_cast<double>(m) / (kMuNodes - 1));
      const Eigen::Vector3d wo(std::sqrt(1.0 - mu * mu), 0.0, mu);
      double base = 0.0;
      double grazing = 0.0;
      for (int i = 0; i < kTableSamples; ++i) {
        const Eigen::Vector3d h =
            SampleVisibleNormal(wo, alpha, (i + 0.5) / kTableSamples, RadicalInverse2(i));
        const double cos_h = wo.dot(h);
        const double mu_i = 2.0 * cos_h * h.z() - wo.z();
        if (mu_i <= 0.0 || cos_h <= 0.0) {
          continue;
        }
        const double lambda_o = SmithLambda(mu, alpha);
        const double weight = (1.0 + lambda_o) / (1.0 + lambda_o + SmithLambda(mu_i, alpha));
        const double schlick = std::pow(1.0 - cos_h, 5);
        base += weight * (1.0 - schlick);
        grazing += weight * schlick;
      }
      directional_[static_cast<size_t>(r) * kMuNodes + m] = {static_cast<float>(base / kTableSamples),
                                                             static_cast<float>(grazing / kTableSamples)};
    }
    // The table is piecewise linear in mu, so E(mu) mu is integrated exactly by Simpson's rule per interval.
    double base = 0.0;
    double grazing = 0.0;
    for (int m = 0; m + 1 < kMuNodes; ++m) {
      const Shares& a = directional_[static_cast<size_t>(r) * kMuNodes + m];
      const Shares& b = directional_[static_cast<size_t>(r) * kMuNodes + m + 1];
      const double x0 = static_cast<double>(m) / (kMuNodes - 1);
      const double x1 = static_cast<double>(m + 1) / (kMuNodes - 1);
      const auto simpson = [&](double f0, double f1) {
        return (x1 - x0) / 6.0 * (f0 * x0 + (f0 + f1) * (x0 + x1) + f1 * x1);
      };
      base += 2.0 * simpson(a.base, b.base);
      grazing += 2.0 * simpson(a.grazing, b.grazing);
    }
    average_[r] = {static_cast<float>(base), static_cast<float>(grazing)};
  }
}

SpecularAlbedo::Shares SpecularAlbedo::Interpolate(float mu, float roughness) const {
  const float x = std::clamp(mu, 0.0F, 1.0F) * (kMuNodes - 1);
  const float y = std::clamp(roughness, 0.0F, 1.0F) * (kRoughnessNodes - 1);
  const int x0 = std::min(static_cast<int>(x), kMuNodes - 2);
  const int y0 = std::min(static_cast<int>(y), kRoughnessNodes - 2);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const Shares* row0 = directional_.data() + static_cast<size_t>(y0) * kMuNodes + x0;
  const Shares* row1 = row0 + kMuNodes;
  const auto mix = [&](float a, float b, float c, float d) {
    return (1.0F - fy) * ((1.0F - fx) * a + fx * b) + fy * ((1.0F - fx) * c + fx * d);
  };
  return {mix(row0[0].base, row0[1].base, row1[0].base, row1[1].base),
          mix(row0[0].grazing, row0[1].grazing, row1[0].grazing, row1[1].grazing)};
}

float SpecularAlbedo::Directional(float mu, float roughness, float f0) const {
  if (f0 <= 0.0F) {
    return 0.0F;
  }
  const Shares shares = Interpolate(mu, roughness);
  return f0 * shares.base + shares.grazing;
}

float SpecularAlbedo::Average(float roughness, float f0) const {
  if (f0 <= 0.0F) {
    return 0.0F;
  }
  const float y = std::clamp(roughness, 0.0F, 1.0F) * (kRoughnessNodes - 1);
  const int y0 = std::min(static_cast<int>(y), kRoughnessNodes - 2);
  const float fy = y - static_cast<float>(y0);
  const Shares& a = average_[y0];
  const Shares& b = average_[y0 + 1];
  return f0 * ((1.0F - fy) * a.base + fy * b.base) + (1.0F - fy) * a.grazing + fy * b.grazing;
}

}  // namespace tessera
