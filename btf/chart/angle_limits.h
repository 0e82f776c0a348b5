// How the chart splits errors by grazing angle: a pair of a view and a light counts up to a limit when the
// polar angles of both are at most that; the last limit takes all.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "btf/math/conventions.h"

namespace tessera {

inline constexpr std::array<double, 4> kAngleLimitsDeg = {45.0, 60.0, 75.0, 90.0};
inline constexpr size_t kNumAngleLimits = kAngleLimitsDeg.size();
inline constexpr size_t kAllAngles = kNumAngleLimits - 1;  // index of the limit that leaves none out
inline constexpr std::array<const char*, kNumAngleLimits> kAngleLimitNames = {"45", "60", "75", "all"};

// The first limit that the pair counts for: it counts for that and all after it.
inline size_t AngleClass(const Direction& view, const Direction& light) {
  constexpr double kRoundingDeg = 1e-6;  // of degrees to radians
  const double polar_deg = DegFromRad(std::max(view.theta_rad, light.theta_rad));
  size_t angle_class = 0;
  while (angle_class + 1 < kNumAngleLimits && polar_deg > kAngleLimitsDeg[angle_class] + kRoundingDeg) {
    ++angle_class;
  }
  return angle_class;
}

}  // namespace tessera
