// Plain-woven cloth: warp yarns along y, weft yarns along x, each passing over one and under the next.
#include <algorithm>
#include <cmath>
#include <vector>

#include "btf/base/rng.h"
#include "btf/math/conventions.h"
#include "btf/meso/material_palette.h"
#include "btf/meso/periodic_noise.h"
#include "btf/meso/procedural_maps.h"

namespace tessera {
namespace {

constexpr double kYarnPitch = 7.0;  // texels between yarns, about: their number is even and whole
constexpr int kTwistsPerPitch = 3;

// What a yarn shows at a place: its height above the cloth's middle, and where on the yarn that is.
struct YarnPoint {
  float height = -10.0F;  // below everything: no yarn here
  float across = 0.0F;    // -1..1
  float twist = 0.0F;     // 0..1, 1 on a fibre's crest
};

// The warp lies on top where the sum of a crossing's indices is even.
double Parity(int sum) {
  return (sum & 1) == 0 ? 1.0 : -1.0;
}

// Each yarn has its own small shift, width and shade.
struct Yarn {
  double shift = 0.0;  // of the pitch
  double half_width = 0.0;
  float shade = 1.0F;
};

// `across` and `along` in pitches; `over` the sign of the yarn's wave where the crossing yarn 0 lies.
YarnPoint At(const Yarn& yarn, double across, double along, double over, double wander) {
  const double offset = (across - yarn.shift - 0.05 * wander) / yarn.half_width;
  YarnPoint point;
  if (std::abs(offset) >= 1.0) {
    return point;
  }
  const double wave = over * std::cos(kPi * along);
  // A flattened sine: the yarn lies flat on top of the one it crosses.
  const double lift = wave * (1.25 - 0.25 * wave * wave);
  const double twist = 0.5 + 0.5 * std::cos(2.0 * kPi * (kTwistsPerPitch * along + 0.55 * offset));
  point.across = static_cast<float>(offset);
  point.twist = static_cast<float>(twist);
  point.height = static_cast<float>(0.55 * lift + 0.75 * std::sqrt(1.0 - offset * offset) + 0.06 * twist);
  return point;
}

}  // namespace

absl::StatusOr<SurfaceMaps> MakeWeave(const MapParams& params, const RunContext& context) {
  constexpr double kOwnScale = 3.2;
  constexpr LinearRgb kWarp{0.035F, 0.085F, 0.24F};  // indigo
  constexpr LinearRgb kWeft{0.66F, 0.50F, 0.28F};    // raw linen
  SurfaceMaps maps = EmptyMaps(params);
  maps.specular_f0 = 0.05F;
  const int n = maps.resolution();
  const double cells = params.cells_per_texel;
  const int num_yarns = 2 * std::max(1, static_cast<int>(std::lround(params.size / (2.0 * kYarnPitch))));
  const double pitch_cells = static_cast<double>(n) / num_yarns;
  const PeriodicField wander_x = BandNoise(n, 18.0 * cells, 0.4, Mix64(params.seed, 1));
  const PeriodicField wander_y = BandNoise(n, 18.0 * cells, 0.4, Mix64(params.seed, 2));
  const PeriodicField fuzz = BandNoise(n, 2.6 * cells, 0.3, Mix64(params.seed, 3));
  Rng rng(Mix64(params.seed, 4));
  std::vector<Yarn> warp(num_yarns);
  std::vector<Yarn> weft(num_yarns);
  for (auto* yarns : {&warp, &weft}) {
    for (Yarn& yarn : *yarns) {
      yarn.shift = 0.06 * (2.0 * rng.NextDouble() - 1.0);
      yarn.half_width = 0.46 + 0.05 * (2.0 * rng.NextDouble() - 1.0);
      yarn.shade = static_cast<float>(1.0 + 0.14 * (2.0 * rng.NextDouble() - 1.0));
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const size_t vertex = static_cast<size_t>(j) * n + i;
      const double x = i / pitch_cells;
      const double y = j / pitch_cells;
      const auto column = static_cast<int>(x);
      const auto row = static_cast<int>(y);
      // Yarn centres lie at half pitches.
      // Yarns wander, so the neighbours may reach in.
      YarnPoint over;
      YarnPoint under;
      int warp_index = 0;
      int weft_index = 0;
      for (int step = -1; step <= 1; ++step) {
        const int c = (column + step + num_yarns) % num_yarns;
        const int r = (row + step + num_yarns) % num_yarns;
        const YarnPoint a =
            At(warp[c], x - (column + step) - 0.5, y - row - 0.5, Parity(c + row), wander_x.values[vertex]);
        const YarnPoint b = At(weft[r], y - (row + step) - 0.5, x - column - 0.5, -Parity(column + r),
                               wander_y.values[vertex]);
        if (a.height > over.height) {
          over = a;
          warp_index = c;
        }
        if (b.height > under.height) {
          under = b;
          weft_index = r;
        }
      }
      const bool is_warp = over.height > under.height;
      const YarnPoint& top = is_warp ? over : under;
      const float gap = -0.55F;  // the dark between the yarns
      maps.height[vertex] = std::max(gap, top.height + 0.02F * fuzz.values[vertex]);
      const LinearRgb& base = is_warp ? kWarp : kWeft;
      const float shade = top.height > gap
                              ? (is_warp ? warp[warp_index].shade : weft[weft_index].shade) *
                                    (0.80F + 0.22F * top.twist) * (1.0F - 0.25F * top.across * top.across) *
                                    (1.0F + 0.05F * fuzz.values[vertex])
                              : 0.35F;
      SetMaterial(maps, vertex, {base[0] * shade, base[1] * shade, base[2] * shade}, is_warp ? 0.46F : 0.54F);
    }
  }
  ScaleHeights(maps, params, kOwnScale);
  return context.stop.stop_requested() ? absl::StatusOr<SurfaceMaps>(context.CheckStop()) : std::move(maps);
}

}  // namespace tessera
