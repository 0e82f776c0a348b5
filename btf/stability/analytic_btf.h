// A BTF in closed form, so that the truth is known for every light and view: bumpy texels of their own
// colours under a Lambertian term and one lobe [Blinn1977].
//
//   const AnalyticSurface surface{.width = 6, .height = 6, .shininess = 20.0};
//   Eigen::Array3d rgb = AnalyticValue(surface, x, y, light, view);
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "btf/data/btf_source.h"

namespace tessera {

struct AnalyticSurface {
  int width = 6;
  int height = 6;
  double shininess = 20.0;  // exponent of the half vector's cosine, > 0
  double specular = 0.5;    // height of the lobe at its peak, >= 0
  uint64_t seed = 1;
};

// On the scale of a BTF (pi f_r cos(theta_light)), >= 0; 0 when light or view is below the horizon. Unit
// vectors, 0 <= x < width, 0 <= y < height.
[[nodiscard]] Eigen::Array3d AnalyticValue(const AnalyticSurface& surface, int x, int y,
                                           const Eigen::Vector3d& light, const Eigen::Vector3d& view);

// All samples in the layout of BtfSource::ReadRows.
[[nodiscard]] std::vector<float> AnalyticSamples(const AnalyticSurface& surface,
                                                 const std::vector<Direction>& views,
                                                 const std::vector<Direction>& lights);

}  // namespace tessera
