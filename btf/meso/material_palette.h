// What the procedural materials share: writing a linear colour, scaling heights.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "btf/meso/procedural_maps.h"
#include "btf/meso/surface_maps.h"

namespace tessera {

using LinearRgb = std::array<float, 3>;

inline LinearRgb Mix(const LinearRgb& a, const LinearRgb& b, float t) {
  return {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])};
}

inline SurfaceMaps EmptyMaps(const MapParams& params) {
  SurfaceMaps maps;
  maps.size = params.size;
  maps.cells_per_texel = params.cells_per_texel;
  const size_t count = static_cast<size_t>(maps.resolution()) * maps.resolution();
  maps.height.resize(count);
  maps.albedo.resize(3 * count);
  maps.roughness.resize(count);
  return maps;
}

// Sets the material of one vertex, brought to the ranges of surface_maps.h.
inline void SetMaterial(SurfaceMaps& maps, size_t vertex, const LinearRgb& albedo, float roughness) {
  for (size_t c = 0; c < 3; ++c) {
    maps.albedo[3 * vertex + c] = std::clamp(albedo[c], 0.0F, 1.0F);
  }
  maps.roughness[vertex] = std::clamp(roughness, 0.0F, 1.0F);
}

// Maps the heights to a range of `own_scale` texels, or of params.height_scale_texels where that is given.
inline void ScaleHeights(SurfaceMaps& maps, const MapParams& params, double own_scale) {
  const auto [low, high] = std::minmax_element(maps.height.begin(), maps.height.end());
  const double target = params.height_scale_texels > 0.0 ? params.height_scale_texels : own_scale;
  const double range = static_cast<double>(*high) - *low;
  const auto scale = static_cast<float>(range > 0.0 ? target / range : 0.0);
  const float lowest = *low;
  for (float& z : maps.height) {
    z = (z - lowest) * scale;
  }
}

}  // namespace tessera
