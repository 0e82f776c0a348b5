// Gray-Scott reaction-diffusion as a glazed relief.
//
//   du/dt = Du lap u - u v^2 + F (1 - u)        dv/dt = Dv lap v + u v^2 - (F + k) v       [Pearson1993]
//
// on one cell per texel with the nine-point Laplacian (4 edge + 1 corner neighbours, weights 4 : 1), whose
// leading error is isotropic; the five-point one would align the pattern with the axes.
#include <algorithm>
#include <cmath>
#include <vector>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/meso/material_palette.h"
#include "btf/meso/periodic_noise.h"
#include "btf/meso/procedural_maps.h"
#include "btf/meso/progress_counter.h"

namespace tessera {
namespace {

// Between spots and worms: spots and short worms, 8 to 11 texels apart and seldom longer than 16, so that
// they fit the strips of a tile set (16 texels high by default). A smaller kKill makes longer worms.
constexpr float kFeed = 0.046F;
constexpr float kKill = 0.0652F;
constexpr float kDiffusionU = 0.14F;  // cells^2 per step
constexpr float kDiffusionV = 0.07F;
constexpr int kSteps = 8000;
constexpr int kStepsPerReport = 200;
constexpr double kSeedDistance = 12.0;  // texels between the drops the reaction grows from
constexpr int kDropRadius = 1;          // texels

// One field with a ghost border, so that inner loops need no wrap.
class Grid {
 public:
  explicit Grid(int n, float value) : n_(n), values_(static_cast<size_t>(n + 2) * (n + 2), value) {}
  float* row(int j) { return values_.data() + static_cast<size_t>(j + 1) * (n_ + 2) + 1; }
  const float* row(int j) const { return values_.data() + static_cast<size_t>(j + 1) * (n_ + 2) + 1; }
  void WrapBorder() {
    for (int j = 0; j < n_; ++j) {
      row(j)[-1] = row(j)[n_ - 1];
      row(j)[n_] = row(j)[0];
    }
    std::copy_n(row(n_ - 1) - 1, n_ + 2, row(-1) - 1);
    std::copy_n(row(0) - 1, n_ + 2, row(n_) - 1);
  }

 private:
  int n_;
  std::vector<float> values_;
};

float Laplacian(const float* above, const float* here, const float* below, int i) {
  return (4.0F * (above[i] + below[i] + here[i - 1] + here[i + 1]) + above[i - 1] + above[i + 1] +
          below[i - 1] + below[i + 1] - 20.0F * here[i]) /
         6.0F;
}

absl::StatusOr<PeriodicField> React(int n, uint64_t seed, const RunContext& context) {
  Grid u(n, 1.0F);
  Grid v(n, 0.0F);
  Grid next_u = u;
  Grid next_v = v;
  for (const auto& [x, y] : BlueNoisePoints(n, kSeedDistance, seed)) {
    for (int dy = -kDropRadius; dy <= kDropRadius; ++dy) {
      for (int dx = -kDropRadius; dx <= kDropRadius; ++dx) {
        const int i = (static_cast<int>(x) + dx + n) % n;
        const int j = (static_cast<int>(y) + dy + n) % n;
        u.row(j)[i] = 0.5F;
        v.row(j)[i] = 0.25F + 0.1F * static_cast<float>((dx * dx + dy * dy) % 3);
      }
    }
  }
  ProgressCounter progress(context, "reaction", kSteps, "steps");
  const int grain = std::max(1, 32768 / n);  // rows worth handing to a thread
  for (int step = 0; step < kSteps; ++step) {
    u.WrapBorder();
    v.WrapBorder();
    ParallelFor(context, 0, n, grain, [&](int64_t begin, int64_t end) {
      for (int j = static_cast<int>(begin); j < end; ++j) {
        const float* u0 = u.row(j - 1);
        const float* u1 = u.row(j);
        const float* u2 = u.row(j + 1);
        const float* v0 = v.row(j - 1);
        const float* v1 = v.row(j);
        const float* v2 = v.row(j + 1);
        float* __restrict out_u = next_u.row(j);
        float* __restrict out_v = next_v.row(j);
        for (int i = 0; i < n; ++i) {
          const float reaction = u1[i] * v1[i] * v1[i];
          out_u[i] = u1[i] + kDiffusionU * Laplacian(u0, u1, u2, i) - reaction + kFeed * (1.0F - u1[i]);
          out_v[i] = v1[i] + kDiffusionV * Laplacian(v0, v1, v2, i) + reaction - (kFeed + kKill) * v1[i];
        }
      }
    });
    std::swap(u, next_u);
    std::swap(v, next_v);
    if ((step + 1) % kStepsPerReport == 0) {
      TESSERA_RETURN_IF_ERROR(context.CheckStop());
      progress.Add(kStepsPerReport);
    }
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  PeriodicField field(n);
  for (int j = 0; j < n; ++j) {
    std::copy_n(v.row(j), n, field.values.begin() + static_cast<std::ptrdiff_t>(j) * n);
  }
  return field;
}

}  // namespace

absl::StatusOr<SurfaceMaps> MakeReactDiffuse(const MapParams& params, const RunContext& context) {
  constexpr double kOwnScale = 2.4;
  constexpr LinearRgb kGroove{0.015F, 0.085F, 0.105F};  // petrol glaze, pooled
  constexpr LinearRgb kFlank{0.42F, 0.10F, 0.035F};     // rust where the glaze breaks
  constexpr LinearRgb kRidge{0.80F, 0.62F, 0.38F};      // ivory
  TESSERA_ASSIGN_OR_RETURN(const PeriodicField reaction, React(params.size, Mix64(params.seed, 1), context));
  SurfaceMaps maps = EmptyMaps(params);
  maps.specular_f0 = 0.05F;
  const int n = maps.resolution();
  const PeriodicField tint = BandNoise(n, 14.0 * params.cells_per_texel, 0.3, Mix64(params.seed, 2));
  std::vector<float> sorted = reaction.values;
  std::sort(sorted.begin(), sorted.end());
  const float low = sorted[sorted.size() / 50];
  const float high = sorted[sorted.size() - 1 - sorted.size() / 50];
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const size_t vertex = static_cast<size_t>(j) * n + i;
      const double x = static_cast<double>(i) / params.cells_per_texel;
      const double y = static_cast<double>(j) / params.cells_per_texel;
      const float t = std::clamp((reaction.Cubic(x, y) - low) / std::max(1e-6F, high - low), 0.0F, 1.0F);
      maps.height[vertex] = std::sqrt(SmoothStep(-0.02F, 1.0F, t));
      LinearRgb albedo = Mix(kGroove, kFlank, SmoothStep(0.18F, 0.45F, t));
      albedo = Mix(albedo, kRidge, SmoothStep(0.45F, 0.8F, t));
      const float shade = 1.0F + 0.06F * tint.values[vertex];
      SetMaterial(maps, vertex, {albedo[0] * shade, albedo[1] * shade, albedo[2] * shade},
                  0.62F - 0.22F * SmoothStep(0.3F, 0.8F, t));
    }
  }
  ScaleHeights(maps, params, kOwnScale);
  return maps;
}

}  // namespace tessera
