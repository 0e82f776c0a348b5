// Directions, angles and colours: the conventions of the whole code base, defined once.
//
//            b (towards row 0, the top of the picture)     n = +Z out of the surface
//            ^                                             t = +X along growing columns
//            |                                             b = +Y towards the top row
//            |   phi from t towards b                      theta from n, in [0, pi/2] above the surface
//            +-------> t (columns)                         phi in [0, 2 pi)
//
// wi points to the light, wo to the eye; both are unit and point away from the surface. Angles are radians;
// degrees exist only at file and command-line edges, in names that end in _deg. Images are row-major, row 0
// on top, pixel centres at +0.5, linear RGB with sRGB primaries. A BTF value is pi f_r cos(theta_i): a white
// diffuser lit along its normal reads 1.
#pragma once

#include <cmath>
#include <numbers>

#include <Eigen/Core>

namespace tessera {

inline constexpr double kPi = std::numbers::pi;

constexpr double RadFromDeg(double deg) {
  return deg * (kPi / 180.0);
}
constexpr double DegFromRad(double rad) {
  return rad * (180.0 / kPi);
}

// A direction as polar angle from the normal and azimuth from t towards b, radians.
struct Direction {
  double theta_rad = 0.0;
  double phi_rad = 0.0;
};

inline Eigen::Vector3d VectorFromDirection(const Direction& d) {
  const double sin_theta = std::sin(d.theta_rad);
  return {sin_theta * std::cos(d.phi_rad), sin_theta * std::sin(d.phi_rad), std::cos(d.theta_rad)};
}

// `v` need not be unit but must not be zero. phi in [0, 2 pi).
inline Direction DirectionFromVector(const Eigen::Vector3d& v) {
  const double theta = std::atan2(std::hypot(v.x(), v.y()), v.z());
  const double phi = std::atan2(v.y(), v.x());
  return {theta, phi < 0.0 ? phi + 2.0 * kPi : phi};
}

// The direction as a texel turned by `turns` quarter turns counter-clockwise sees it in its own, unturned
// frame: (x, y) -> (y, -x), `turns` times.
inline Eigen::Vector3d UnturnedFromTurned(Eigen::Vector3d v, int turns) {
  for (int i = 0; i < (turns & 3); ++i) {
    v = Eigen::Vector3d(v.y(), -v.x(), v.z());
  }
  return v;
}

}  // namespace tessera
