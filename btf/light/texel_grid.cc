#include "btf/light/texel_grid.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "btf/math/conventions.h"
#include "btf/math/hemisphere_gram.h"

namespace tessera {
namespace {

// The solid angle of a part of the angular map, by Green's theorem in polar coordinates: its density is
// sin(pi r) pi / r, 0 beyond the rim, so F(r) = 1 - cos(pi min(r, 1)) is what lies within r in a unit of
// angle, and the part's solid angle the integral of F dangle around it, dangle = (u dv - v du) / r^2.
// Neighbours share the integral along their edge, so that all of them add up to that around the picture, 4
// pi.
class AngularEdges {
 public:
  explicit AngularEdges(int width)
      : width_(width), rule_(GaussLegendre(width >= kFineWidth ? kFineNodes : kCoarseNodes)) {}

  [[nodiscard]] double SolidAngle(int x, int y) const {
    const double u0 = At(x);
    const double u1 = At(x + 1);
    const double v0 = At(y);
    const double v1 = At(y + 1);
    if (std::hypot(std::max({0.0, u0, -u1}), std::max({0.0, v0, -v1})) >= 1.0) {
      return 0.0;
    }
    return std::max(0.0, Edge(u1, v0, v1) - Edge(u0, v0, v1) + Edge(v1, u0, u1) - Edge(v0, u0, u1));
  }

 private:
  // The integrand is a power series in (pi r)^2 / 2: over a texel of 1/32 four nodes leave 1e-15 of it, over
  // one of 2 twelve.
  static constexpr int kFineWidth = 64;
  static constexpr int kFineNodes = 4;
  static constexpr int kCoarseNodes = 12;

  [[nodiscard]] double At(int i) const { return 2.0 * i / width_ - 1.0; }

  // Along u = c from v = `begin` to `end`, which is also that along v = c, turned.
  [[nodiscard]] double Edge(double c, double begin, double end) const {
    if (c == 0.0) {
      return 0.0;
    }
    const double rim = std::sqrt(std::max(0.0, 1.0 - c * c));
    const double inner_begin = std::clamp(begin, -rim, rim);
    const double inner_end = std::clamp(end, -rim, rim);
    return Outer(c, begin, std::min(end, -rim)) + Inner(c, inner_begin, inner_end) +
           Outer(c, std::max(begin, rim), end);
  }

  // Beyond the rim, where F is 2.
  static double Outer(double c, double begin, double end) {
    return begin < end ? 2.0 * (std::atan(end / c) - std::atan(begin / c)) : 0.0;
  }

  [[nodiscard]] double Inner(double c, double begin, double end) const {
    double sum = 0.0;
    for (Eigen::Index i = 0; i < rule_.nodes.size() && begin < end; ++i) {
      const double v = begin + (end - begin) * rule_.nodes[i];
      const double half_sine = std::sin(0.5 * kPi * std::hypot(c, v));
      sum += rule_.weights[i] * 2.0 * half_sine * half_sine / (c * c + v * v);
    }
    return c * (end - begin) * sum;
  }

  int width_;
  GaussLegendreRule rule_;
};

std::vector<double> AngularSolidAngles(int width) {
  const AngularEdges edges(width);
  std::vector<double> solid_angles(static_cast<size_t>(width) * width);
  const auto at = [&](int x, int y) -> double& { return solid_angles[static_cast<size_t>(y) * width + x]; };
  for (int y = 0; y < (width + 1) / 2; ++y) {
    for (int x = 0; x <= y; ++x) {
      const double solid_angle = edges.SolidAngle(x, y);
      const int far_x = width - 1 - x;
      const int far_y = width - 1 - y;
      at(x, y) = at(far_x, y) = at(x, far_y) = at(far_x, far_y) = solid_angle;
      at(y, x) = at(far_y, x) = at(y, far_x) = at(far_y, far_x) = solid_angle;
    }
  }
  return solid_angles;
}

std::vector<double> EquirectSolidAngles(int width, int height) {
  std::vector<double> solid_angles(height);
  for (int y = 0; y < height; ++y) {
    // sin e0 - sin e1 = 2 cos(mean) sin(half the difference), which loses nothing at the poles.
    const double elevation = kPi * (0.5 - (y + 0.5) / height);
    solid_angles[y] = 2.0 * kPi / width * 2.0 * std::cos(elevation) * std::sin(0.5 * kPi / height);
  }
  return solid_angles;
}

}  // namespace

TexelGrid::TexelGrid(EnvironmentLayout layout, int width, int height)
    : layout_(layout),
      width_(width),
      height_(height),
      solid_angles_(layout == EnvironmentLayout::kEquirect ? EquirectSolidAngles(width, height)
                                                           : AngularSolidAngles(width)) {
  assert(width >= 1 && height >= 1 && (layout == EnvironmentLayout::kEquirect || width == height));
}

Eigen::Vector3d TexelGrid::DirectionAt(double column, double row) const {
  if (layout_ == EnvironmentLayout::kEquirect) {
    const double azimuth = 2.0 * kPi * (column / width_ - 0.5);
    const double elevation = kPi * (0.5 - row / height_);
    return {std::cos(elevation) * std::sin(azimuth), std::sin(elevation),
            -std::cos(elevation) * std::cos(azimuth)};
  }
  const double u = 2.0 * column / width_ - 1.0;
  const double v = 1.0 - 2.0 * row / height_;
  const double r = std::hypot(u, v);
  if (r == 0.0 || r >= 1.0) {
    return {0.0, 0.0, r == 0.0 ? -1.0 : 1.0};
  }
  const double from_axis = std::sin(kPi * r) / r;
  return {u * from_axis, v * from_axis, -std::cos(kPi * r)};
}

Eigen::Vector2d TexelGrid::Place(const Eigen::Vector3d& direction) const {
  const double across = std::hypot(direction.x(), direction.y());
  if (layout_ == EnvironmentLayout::kEquirect) {
    const double azimuth = std::atan2(direction.x(), -direction.z());
    const double elevation = std::atan2(direction.y(), std::hypot(direction.x(), direction.z()));
    return {width_ * (0.5 + azimuth / (2.0 * kPi)), height_ * (0.5 - elevation / kPi)};
  }
  const double r = std::atan2(across, -direction.z()) / kPi;
  // All of the rim is +z.
  const double u = across > 0.0 ? r * direction.x() / across : r;
  const double v = across > 0.0 ? r * direction.y() / across : 0.0;
  return {0.5 * width_ * (1.0 + u), 0.5 * height_ * (1.0 - v)};
}

}  // namespace tessera
