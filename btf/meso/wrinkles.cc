// Wrinkled leather: the zero lines of isotropic band noise are its creases.
#include <algorithm>
#include <cmath>

#include "btf/base/rng.h"
#include "btf/meso/material_palette.h"
#include "btf/meso/periodic_noise.h"
#include "btf/meso/procedural_maps.h"

namespace tessera {
namespace {

// 0 on the zero lines of `noise`, rising to 1 away from them with a rounded shoulder.
float Grain(float noise, float width) {
  const float t = std::abs(noise) / width;
  return t / std::sqrt(1.0F + t * t);
}

}  // namespace

absl::StatusOr<SurfaceMaps> MakeWrinkles(const MapParams& params, const RunContext& context) {
  constexpr double kOwnScale = 3.2;
  constexpr LinearRgb kCrease{0.075F, 0.022F, 0.010F};
  constexpr LinearRgb kHide{0.33F, 0.115F, 0.040F};
  constexpr LinearRgb kWorn{0.52F, 0.24F, 0.105F};
  SurfaceMaps maps = EmptyMaps(params);
  const int n = maps.resolution();
  const double cells = params.cells_per_texel;
  const auto noise = [&](double wavelength, double bandwidth, uint64_t stream) {
    return BandNoise(n, wavelength * cells, bandwidth, Mix64(params.seed, stream));
  };
  const PeriodicField folds = noise(30.0, 0.25, 1);
  const PeriodicField grains = noise(19.0, 0.3, 2);
  const PeriodicField pores = noise(4.0, 0.3, 3);
  const PeriodicField warp_x = noise(18.0, 0.3, 4);
  const PeriodicField warp_y = noise(18.0, 0.3, 5);
  const PeriodicField tint = noise(14.0, 0.3, 6);
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const size_t vertex = static_cast<size_t>(j) * n + i;
      const double x = i + 1.2 * cells * warp_x.values[vertex];
      const double y = j + 1.2 * cells * warp_y.values[vertex];
      const float fold = Grain(folds.Cubic(x, y), 0.55F);
      const float grain = Grain(grains.Cubic(x, y), 0.38F);
      const float h = 0.38F * fold + 0.62F * grain * (0.75F + 0.25F * fold);
      maps.height[vertex] = h + 0.015F * pores.values[vertex];
      LinearRgb albedo = Mix(kCrease, kHide, SmoothStep(0.12F, 0.62F, h));
      albedo =
          Mix(albedo, kWorn, SmoothStep(0.62F, 0.98F, h) * (0.75F + 0.25F * std::tanh(tint.values[vertex])));
      SetMaterial(maps, vertex, albedo,
                  0.60F - 0.20F * SmoothStep(0.3F, 0.9F, h) + 0.02F * pores.values[vertex]);
    }
  }
  ScaleHeights(maps, params, kOwnScale);
  return context.stop.stop_requested() ? absl::StatusOr<SurfaceMaps>(context.CheckStop()) : std::move(maps);
}

}  // namespace tessera
