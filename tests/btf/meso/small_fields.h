// Small surfaces and direction sets that the tests of btf/meso share.
#pragma once

#include <cmath>
#include <vector>

#include "btf/base/run_context.h"
#include "btf/data/btf_source.h"
#include "btf/math/conventions.h"
#include "btf/meso/surface_maps.h"
#include "btf/meso/tracer.h"

namespace tessera {

inline SurfaceMaps FlatField(int size, float albedo, float roughness, float f0) {
  SurfaceMaps maps;
  maps.size = size;
  maps.cells_per_texel = 1;
  const size_t count = static_cast<size_t>(size) * size;
  maps.height.assign(count, 0.0F);
  maps.albedo.assign(3 * count, albedo);
  maps.roughness.assign(count, roughness);
  maps.specular_f0 = f0;
  return maps;
}

// Hills and pits of a few texels, steep enough to shadow and hide each other, coloured.
inline SurfaceMaps HillyField(int size, int cells_per_texel, float range, float roughness, float f0) {
  SurfaceMaps maps;
  maps.size = size;
  maps.cells_per_texel = cells_per_texel;
  maps.specular_f0 = f0;
  const int n = maps.resolution();
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const double x = 2.0 * kPi * i / n;
      const double y = 2.0 * kPi * j / n;
      const double wave = std::cos(2.0 * x + std::sin(y)) * std::cos(y) + 0.4 * std::sin(x - 2.0 * y);
      maps.height.push_back(static_cast<float>(range / 2.8 * wave));
      maps.albedo.push_back(static_cast<float>(0.7 + 0.25 * std::sin(x)));
      maps.albedo.push_back(static_cast<float>(0.5 + 0.25 * std::cos(y)));
      maps.albedo.push_back(static_cast<float>(0.3 + 0.20 * std::sin(x + y)));
      maps.roughness.push_back(roughness);
    }
  }
  return maps;
}

inline Direction DirectionFromDeg(double polar_deg, double azimuth_deg) {
  return {RadFromDeg(polar_deg), RadFromDeg(azimuth_deg)};
}

// 81 directions: 1, 6, 12, 18, 20 and 24 of them at 0, 15, 30, 45, 60 and 75 degrees, as in UBO2003.
inline std::vector<Direction> UboDirections() {
  constexpr int kCounts[] = {1, 6, 12, 18, 20, 24};
  std::vector<Direction> directions;
  for (int ring = 0; ring < 6; ++ring) {
    for (int i = 0; i < kCounts[ring]; ++i) {
      directions.push_back(DirectionFromDeg(15.0 * ring, 360.0 * i / kCounts[ring]));
    }
  }
  return directions;
}

// `count` directions of equal solid angle over the hemisphere, on a spiral.
inline std::vector<Direction> SpiralDirections(int count) {
  std::vector<Direction> directions;
  const double golden = kPi * (3.0 - std::sqrt(5.0));
  for (int i = 0; i < count; ++i) {
    const double phi = std::fmod(i * golden, 2.0 * kPi);
    directions.push_back({std::acos((i + 0.5) / count), phi});
  }
  return directions;
}

inline BtfInfo InfoFor(const SurfaceMaps& maps, std::vector<Direction> views, std::vector<Direction> lights) {
  return {.width = maps.size, .height = maps.size, .views = std::move(views), .lights = std::move(lights)};
}

// Every row of a source.
inline std::vector<float> ReadAll(BtfSource& source, const RunContext& context = {}) {
  std::vector<float> samples(source.SamplesPerRow() * source.info().height);
  const absl::Status status = source.ReadRows(0, source.info().height, samples, context);
  return status.ok() ? samples : std::vector<float>{};
}

}  // namespace tessera
