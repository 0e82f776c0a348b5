// Environments for tests: pictures of a function of direction.
#pragma once

#include <filesystem>
#include <functional>
#include <utility>

#include <gtest/gtest.h>

#include "btf/light/environment.h"
#include "btf/math/conventions.h"

namespace tessera {

// Each texel takes the function at its centre, in the picture's own directions.
inline Image PictureOf(EnvironmentLayout layout, int height,
                       const std::function<Eigen::Array3d(const Eigen::Vector3d&)>& radiance) {
  const int width = layout == EnvironmentLayout::kEquirect ? 2 * height : height;
  const TexelGrid grid(layout, width, height);
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Array3d rgb = radiance(grid.Direction(x, y));
      for (int channel = 0; channel < 3; ++channel) {
        image.at(x, y)[channel] = static_cast<float>(rgb[channel]);
      }
    }
  }
  return image;
}

inline Environment EnvironmentOf(EnvironmentLayout layout, int height,
                                 const std::function<Eigen::Array3d(const Eigen::Vector3d&)>& radiance,
                                 const EnvironmentOptions& options = {}) {
  auto environment = Environment::Create(PictureOf(layout, height, radiance), "generated", options);
  EXPECT_TRUE(environment.ok()) << environment.status();
  return *std::move(environment);
}

// A blue sky over brown ground, with a sun of a few degrees: no two directions alike.
inline Eigen::Array3d SunnySky(const Eigen::Vector3d& d) {
  const double up = 0.5 * (1.0 + d.y());
  Eigen::Array3d rgb = up * Eigen::Array3d(0.5, 0.7, 1.2) + (1.0 - up) * Eigen::Array3d(0.3, 0.2, 0.1) +
                       0.1 * (1.0 + d.x()) + 0.05 * (1.0 + d.x() * d.z());
  if (d.dot(Eigen::Vector3d(0.5, 0.6, -0.6).normalized()) > 0.998) {
    rgb += Eigen::Array3d(300.0, 280.0, 240.0);
  }
  return rgb;
}

}  // namespace tessera
