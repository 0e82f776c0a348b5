// How far from the normal a set of directions reaches.
#pragma once

#include <algorithm>
#include <span>

#include "btf/math/conventions.h"

namespace tessera {

// The largest polar angle, within [0, pi/2]; 0 when there are no directions.
inline double MaxThetaRad(std::span<const Direction> directions) {
  double largest = 0.0;
  for (const Direction& direction : directions) {
    largest = std::max(largest, std::min(direction.theta_rad, kPi / 2.0));
  }
  return largest;
}

}  // namespace tessera
