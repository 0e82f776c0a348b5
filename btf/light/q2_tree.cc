#include "btf/light/q2_tree.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <queue>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/math/conventions.h"

namespace tessera {
namespace {

constexpr int kHealpixFaces = 12;
// 4^8 quads a face, 0.23 degrees wide: half a sun.
constexpr int kMaxQ2Level = 8;
// Smaller pictures have their texels cut, so that there are lights enough to be had.
constexpr int kMinQ2Rows = 128;
// Of a part's mean square spread: what lies in several quads is never without any, whatever rounding says.
constexpr double kLeastSpread = 1e-14;

double LuminanceOf(const Eigen::Array3d& rgb) {
  return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

// Bits of x at even places.
int64_t SpreadBits(int64_t x) {
  int64_t spread = 0;
  for (int bit = 0; (x >> bit) != 0; ++bit) {
    spread |= ((x >> bit) & 1) << (2 * bit);
  }
  return spread;
}

// Where a face stands when faces go by longitude: north, equator and south of each quarter.
int64_t ByLongitude(int64_t face) {
  return face % 4 * 3 + face / 4;
}

}  // namespace

int64_t HealpixQuad(const Eigen::Vector3d& direction, int level) {
  assert(level >= 0 && level <= 15);
  const int64_t side = int64_t{1} << level;
  const auto n = static_cast<double>(side);
  // About +y; azimuth in quarter turns, [0, 4).
  const double z = direction.y();
  const double azimuth = std::atan2(direction.x(), direction.z()) * (2.0 / kPi);
  const double t = azimuth < 0.0 ? std::min(azimuth + 4.0, std::nextafter(4.0, 0.0)) : azimuth;
  int64_t face = 0;
  int64_t x = 0;  // south-east
  int64_t y = 0;  // south-west
  if (std::abs(z) <= 2.0 / 3.0) {
    // Lines that fall and rise by one quad in an eighth of a turn; those of the face's own, and those before.
    const auto falling = static_cast<int64_t>(std::floor(n * (0.5 + t - 0.75 * z)));
    const auto rising = static_cast<int64_t>(std::floor(n * (0.5 + t + 0.75 * z)));
    const int64_t from_falling = falling / side;
    const int64_t from_rising = rising / side;
    face = from_falling == from_rising  ? 4 + from_falling % 4
           : from_falling < from_rising ? from_falling
                                        : 8 + from_rising;
    x = rising % side;
    y = side - 1 - falling % side;
  } else {
    const int64_t quarter = std::min<int64_t>(static_cast<int64_t>(t), 3);
    const double within = t - static_cast<double>(quarter);
    // sqrt(3 (1 - |z|)), without loss at the pole.
    const double across = direction.x() * direction.x() + direction.z() * direction.z();
    const double from_pole = n * std::sqrt(3.0 * across / (1.0 + std::abs(z)));
    const int64_t left = std::min(side - 1, static_cast<int64_t>(from_pole * within));
    const int64_t right = std::min(side - 1, static_cast<int64_t>(from_pole * (1.0 - within)));
    face = z > 0.0 ? quarter : quarter + 8;
    x = z > 0.0 ? side - 1 - right : left;
    y = z > 0.0 ? side - 1 - left : right;
  }
  return face * side * side + SpreadBits(x) + 2 * SpreadBits(y);
}

Q2Tree::Sums& Q2Tree::Sums::operator+=(const Sums& other) {
  irradiance += other.irradiance;
  moment += other.moment;
  solid_angle += other.solid_angle;
  return *this;
}

Q2Tree::Q2Tree(const Environment& environment) : world_from_picture_(environment.world_from_picture()) {
  const TexelGrid& texels = environment.grid();
  const int cuts = (kMinQ2Rows + texels.height() - 1) / texels.height();
  const TexelGrid points(texels.layout(), texels.width() * cuts, texels.height() * cuts);
  // As wide as points, or wider.
  while (level_ < kMaxQ2Level && (4 << level_) < points.height()) {
    ++level_;
  }
  const int64_t quads_per_face = int64_t{1} << (2 * level_);
  quads_.resize(static_cast<size_t>(kHealpixFaces * quads_per_face));
  for (int y = 0; y < points.height(); ++y) {
    for (int x = 0; x < points.width(); ++x) {
      const double solid_angle = points.SolidAngle(x, y);
      if (solid_angle == 0.0) {
        continue;
      }
      const Eigen::Vector3d direction = points.Direction(x, y);
      const Eigen::Array3d irradiance = environment.TexelRadiance(x / cuts, y / cuts) * solid_angle;
      const int64_t quad = HealpixQuad(direction, level_);
      const int64_t place = ByLongitude(quad / quads_per_face) * quads_per_face + quad % quads_per_face;
      quads_[static_cast<size_t>(place)] += {irradiance, LuminanceOf(irradiance) * direction, solid_angle};
    }
  }
}

Q2Tree::Sums Q2Tree::SumOf(int64_t first, int64_t count) const {
  constexpr int64_t kRun = 16;
  Sums sums;
  if (count <= kRun) {
    for (int64_t i = first; i < first + count; ++i) {
      sums += quads_[static_cast<size_t>(i)];
    }
    return sums;
  }
  // By halves: rounding grows with the logarithm.
  sums = SumOf(first, count / 2);
  sums += SumOf(first + count / 2, count - count / 2);
  return sums;
}

Q2Tree::Part Q2Tree::MakePart(int64_t first, int64_t count) const {
  Part part{first, count, SumOf(first, count)};
  const double luminance = LuminanceOf(part.sums.irradiance);
  if (count > 1 && luminance > 0.0) {
    // With m the mean of unit vectors, 1 - |m|^2 is their mean square distance from it.
    const double mean_square = 1.0 - (part.sums.moment / luminance).squaredNorm();
    part.importance = luminance * std::sqrt(std::max(mean_square, kLeastSpread));
  }
  return part;
}

int64_t Q2Tree::FirstHalf(int64_t count) const {
  const int64_t quads_per_face = int64_t{1} << (2 * level_);
  return count > quads_per_face ? count / quads_per_face / 2 * quads_per_face : count / 2;
}

absl::StatusOr<std::vector<EnvironmentLight>> Q2Tree::Lights(int count) const {
  if (count < 1 || count > kMaxQ2Lights) {
    return absl::InvalidArgumentError(absl::StrCat(count, " lights, expected 1 to ", kMaxQ2Lights));
  }
  const auto is_less = [](const Part& a, const Part& b) {
    return std::pair(a.importance, -a.first) < std::pair(b.importance, -b.first);
  };
  std::priority_queue<Part, std::vector<Part>, decltype(is_less)> parts(is_less);
  const auto push_if_lit = [&](const Part& part) {
    if ((part.sums.irradiance > 0.0).any()) {
      parts.push(part);
    }
  };
  push_if_lit(MakePart(0, static_cast<int64_t>(quads_.size())));
  // A part whose other half is dark is only made smaller.
  while (!parts.empty() && std::cmp_less(parts.size(), count) && parts.top().importance > 0.0) {
    const Part part = parts.top();
    parts.pop();
    const int64_t half = FirstHalf(part.count);
    push_if_lit(MakePart(part.first, half));
    push_if_lit(MakePart(part.first + half, part.count - half));
  }
  std::vector<Part> ordered;
  for (; !parts.empty(); parts.pop()) {
    ordered.push_back(parts.top());
  }
  std::ranges::sort(ordered, [](const Part& a, const Part& b) {
    return std::pair(-LuminanceOf(a.sums.irradiance), a.first) <
           std::pair(-LuminanceOf(b.sums.irradiance), b.first);
  });
  std::vector<EnvironmentLight> lights;
  lights.reserve(ordered.size());
  for (const Part& part : ordered) {
    lights.push_back(LightOf(part));
  }
  return lights;
}

EnvironmentLight Q2Tree::LightOf(const Part& part) const {
  // Light from all around has no direction: from above.
  constexpr double kNoDirection = 1e-9;
  const double length = part.sums.moment.norm();
  const bool has_direction = length > kNoDirection * LuminanceOf(part.sums.irradiance);
  return {world_from_picture_ *
              (has_direction ? Eigen::Vector3d(part.sums.moment / length) : Eigen::Vector3d(0, 1, 0)),
          part.sums.irradiance, part.sums.solid_angle};
}

}  // namespace tessera
