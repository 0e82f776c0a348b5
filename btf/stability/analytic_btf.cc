#include "btf/stability/analytic_btf.h"

#include <algorithm>
#include <cmath>

#include "btf/base/rng.h"

namespace tessera {
namespace {

struct AnalyticTexel {
  Eigen::Array3d albedo;
  Eigen::Vector3d normal;
};

AnalyticTexel TexelAt(const AnalyticSurface& surface, int x, int y) {
  constexpr double kLargestSlope = 0.3;
  Rng rng(Mix64(surface.seed, static_cast<uint64_t>(y) * surface.width + x));
  AnalyticTexel texel;
  for (int channel = 0; channel < 3; ++channel) {
    texel.albedo[channel] = 0.1 + 0.6 * rng.NextDouble();
  }
  const double slope_x = kLargestSlope * (2.0 * rng.NextDouble() - 1.0);
  const double slope_y = kLargestSlope * (2.0 * rng.NextDouble() - 1.0);
  texel.normal = Eigen::Vector3d(-slope_x, -slope_y, 1.0).normalized();
  return texel;
}

Eigen::Array3d Value(const AnalyticSurface& surface, const AnalyticTexel& texel, const Eigen::Vector3d& light,
                     const Eigen::Vector3d& view) {
  if (light.z() <= 0.0 || view.z() <= 0.0) {
    return Eigen::Array3d::Zero();
  }
  const double lit = std::max(0.0, texel.normal.dot(light));
  const double half = std::max(0.0, texel.normal.dot((light + view).normalized()));
  return texel.albedo * lit + surface.specular * std::pow(half, surface.shininess) * lit;
}

}  // namespace

Eigen::Array3d AnalyticValue(const AnalyticSurface& surface, int x, int y, const Eigen::Vector3d& light,
                             const Eigen::Vector3d& view) {
  return Value(surface, TexelAt(surface, x, y), light, view);
}

std::vector<float> AnalyticSamples(const AnalyticSurface& surface, const std::vector<Direction>& views,
                                   const std::vector<Direction>& lights) {
  const size_t num_images = views.size() * lights.size();
  std::vector<float> samples(static_cast<size_t>(surface.width) * surface.height * 3 * num_images);
  float* out = samples.data();
  for (int y = 0; y < surface.height; ++y) {
    for (int x = 0; x < surface.width; ++x) {
      const AnalyticTexel texel = TexelAt(surface, x, y);
      for (size_t image = 0; image < num_images; ++image) {
        const Eigen::Array3d rgb = Value(surface, texel, VectorFromDirection(lights[image % lights.size()]),
                                         VectorFromDirection(views[image / lights.size()]));
        for (size_t channel = 0; channel < 3; ++channel) {
          out[channel * num_images + image] = static_cast<float>(rgb[static_cast<Eigen::Index>(channel)]);
        }
      }
      out += 3 * num_images;
    }
  }
  return samples;
}

}  // namespace tessera
