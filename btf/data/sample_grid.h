// From images with angles to the full product of views and lights that a BTF is.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/math/conventions.h"

namespace tessera {

// Degrees as files give them: polar from the normal, azimuth counter-clockwise from the columns' direction.
struct AnglesDeg {
  double polar_deg = 0.0;
  double azimuth_deg = 0.0;
};

struct SampleAngles {
  std::string name;  // for messages
  AnglesDeg light;
  AnglesDeg view;
};

struct SampleGrid {
  std::vector<Direction> views;   // in order of polar angle, then azimuth
  std::vector<Direction> lights;  // likewise
  std::vector<size_t> image;      // [view][light], index into the samples
};

// Directions that agree to 1/1000 degree are one direction, azimuths are taken modulo 360, and at polar angle
// 0 every azimuth is the same direction. Errors: INVALID_ARGUMENT naming angles that are not finite or out of
// range (polar 0 to 90, azimuth -360 to 720), pairs of a view and a light that have several images, and pairs
// that have none.
[[nodiscard]] absl::StatusOr<SampleGrid> BuildSampleGrid(std::span<const SampleAngles> samples);

}  // namespace tessera
