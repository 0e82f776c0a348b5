// Round holes in a weathered slab.
#include <algorithm>
#include <cmath>
#include <vector>

#include "btf/base/rng.h"
#include "btf/meso/material_palette.h"
#include "btf/meso/periodic_noise.h"
#include "btf/meso/procedural_maps.h"

namespace tessera {
namespace {

constexpr double kSpacing = 11.5;  // texels, at least, between centres
constexpr double kSmallestRadius = 2.6;
constexpr double kLargestRadius = 4.6;
constexpr double kReach = 9.0;  // texels from the centre that a hole still shapes

// Height of a hole of radius r at distance d from its centre, the slab at 0 and the floor near -1: a bowl
// with steep walls and a worn, slightly raised lip.
float HoleProfile(double d, double r) {
  const auto wall =
      SmoothStep(static_cast<float>(0.55 * r), static_cast<float>(r + 0.5), static_cast<float>(d));
  const auto floor = static_cast<float>(0.10 * (d / r) * (d / r));
  const double lip = (d - r - 1.0) / 1.3;
  return -(1.0F - wall) * (1.0F - std::min(0.3F, floor)) + 0.07F * static_cast<float>(std::exp(-lip * lip));
}

}  // namespace

absl::StatusOr<SurfaceMaps> MakeHoles(const MapParams& params, const RunContext& context) {
  constexpr double kOwnScale = 6.0;
  constexpr LinearRgb kSlab{0.50F, 0.34F, 0.17F};
  constexpr LinearRgb kSlabDark{0.36F, 0.20F, 0.085F};
  constexpr LinearRgb kLip{0.68F, 0.52F, 0.30F};
  constexpr LinearRgb kInside{0.26F, 0.075F, 0.035F};
  SurfaceMaps maps = EmptyMaps(params);
  const int n = maps.resolution();
  const double cells = params.cells_per_texel;
  const PeriodicField grain = BandNoise(n, 3.2 * cells, 0.4, Mix64(params.seed, 2));
  const PeriodicField stain = BandNoise(n, 13.0 * cells, 0.4, Mix64(params.seed, 3));

  PeriodicField profile(n);
  Rng rng(Mix64(params.seed, 4));
  for (const auto& [x, y] : BlueNoisePoints(params.size, kSpacing, Mix64(params.seed, 1))) {
    const double radius = kSmallestRadius + (kLargestRadius - kSmallestRadius) * rng.NextDouble();
    const auto first_i = static_cast<int>(std::floor((x - kReach) * cells));
    const auto last_i = static_cast<int>(std::ceil((x + kReach) * cells));
    const auto first_j = static_cast<int>(std::floor((y - kReach) * cells));
    const auto last_j = static_cast<int>(std::ceil((y + kReach) * cells));
    for (int j = first_j; j <= last_j; ++j) {
      for (int i = first_i; i <= last_i; ++i) {
        const double d = std::hypot(i / cells - x, j / cells - y);
        if (d < kReach) {
          const int column = ((i % n) + n) % n;
          const int row = ((j % n) + n) % n;
          profile.values[static_cast<size_t>(row) * n + column] += HoleProfile(d, radius);
        }
      }
    }
  }
  for (size_t vertex = 0; vertex < maps.height.size(); ++vertex) {
    const float h = profile.values[vertex];
    maps.height[vertex] = h + 0.012F * grain.values[vertex];
    const float inside = SmoothStep(-0.05F, -0.6F, h);
    LinearRgb albedo = Mix(kSlab, kSlabDark, SmoothStep(-0.6F, 1.6F, stain.values[vertex]));
    albedo = Mix(albedo, kLip, SmoothStep(0.01F, 0.07F, h));
    albedo = Mix(albedo, kInside, inside);
    const float shade = 1.0F + 0.07F * grain.values[vertex];
    SetMaterial(maps, vertex, {albedo[0] * shade, albedo[1] * shade, albedo[2] * shade},
                0.48F + 0.05F * grain.values[vertex] + 0.25F * inside);
  }
  ScaleHeights(maps, params, kOwnScale);
  return context.stop.stop_requested() ? absl::StatusOr<SurfaceMaps>(context.CheckStop()) : std::move(maps);
}

}  // namespace tessera
