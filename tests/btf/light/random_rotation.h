// Directions and rotations for tests.
#pragma once

#include <Eigen/Geometry>

#include "btf/base/rng.h"
#include "btf/math/conventions.h"

namespace tessera {

inline Eigen::Vector3d RandomDirection(Rng& rng) {
  const double z = 2.0 * rng.NextDouble() - 1.0;
  const double phi = 2.0 * kPi * rng.NextDouble();
  const double across = std::sqrt(1.0 - z * z);
  return {across * std::cos(phi), across * std::sin(phi), z};
}

// Uniform over all rotations (K. Shoemake, Uniform random rotations, Graphics Gems III, 1992).
inline Eigen::Matrix3d RandomRotation(Rng& rng) {
  const double u = rng.NextDouble();
  const double a = 2.0 * kPi * rng.NextDouble();
  const double b = 2.0 * kPi * rng.NextDouble();
  const Eigen::Quaterniond q(std::sqrt(1.0 - u) * std::sin(a), std::sqrt(1.0 - u) * std::cos(a),
                             std::sqrt(u) * std::sin(b), std::sqrt(u) * std::cos(b));
  return q.normalized().toRotationMatrix();
}

}  // namespace tessera
