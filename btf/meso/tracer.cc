#include "btf/meso/tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <utility>

#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/meso/facets.h"
#include "btf/meso/height_field_scene.h"
#include "btf/meso/microfacet.h"
#include "btf/meso/progress_counter.h"
#include "btf/meso/surface_light.h"

namespace tessera {
namespace {

constexpr int kTexelGrain = 4;
// View rays start this far above the highest point, texels, so that it is not missed by rounding.
constexpr double kClearance = 1e-2;
// A facet that a view ray meets faces it; rounding of its normal may say otherwise.
constexpr float kMinViewCosine = 1e-4F;

double RadicalInverse2(uint32_t bits) {
  bits = (bits << 16U) | (bits >> 16U);
  bits = ((bits & 0x00ff00ffU) << 8U) | ((bits & 0xff00ff00U) >> 8U);
  bits = ((bits & 0x0f0f0f0fU) << 4U) | ((bits & 0xf0f0f0f0U) >> 4U);
  bits = ((bits & 0x33333333U) << 2U) | ((bits & 0xccccccccU) >> 2U);
  bits = ((bits & 0x55555555U) << 1U) | ((bits & 0xaaaaaaaaU) >> 1U);
  return bits * 0x1.0p-32;
}

// Of one view: the half vector to every light and (1 - wo.h)^5, [stride] each.
struct ViewTables {
  Eigen::Vector3d direction;
  std::vector<float> half_x, half_y, half_z, schlick;
};

// The lights, [stride]; the excess points down, so that it is always turned away.
struct LightTables {
  std::vector<float> x, y, z;
};

// What one hit brings to every light.
struct HitTerms {
  std::array<float, 3> normal{};
  std::array<float, 3> diffuse{};  // facet.diffuse (1 - E(n.wo))
  float view_cosine = 1.0F;        // n.wo
  float alpha_squared = 1.0F;
  float smith_view = 1.0F;  // sqrt(a2 + (1 - a2) (n.wo)^2)
  float f0 = 0.0F;
  float lobe = 0.0F;  // a2 / 2, or 0 where there is no lobe
};

// Adds one hit to the sums of every light: the innermost loop, 1.7 billion turns at 128x128x81x81. A function
// of its own with restricted parameters, because gcc vectorises it only so.
[[gnu::noinline]] void AddLights(const HitTerms& hit, int stride, const uint8_t* __restrict visibility,
                                 const float* __restrict direct, const float* __restrict indirect_r,
                                 const float* __restrict indirect_g, const float* __restrict indirect_b,
                                 const float* __restrict lx, const float* __restrict ly,
                                 const float* __restrict lz, const float* __restrict hx,
                                 const float* __restrict hy, const float* __restrict hz,
                                 const float* __restrict schlick, float* __restrict sum_r,
                                 float* __restrict sum_g, float* __restrict sum_b) {
  const auto [nx, ny, nz] = hit.normal;
  const auto [diffuse_r, diffuse_g, diffuse_b] = hit.diffuse;
  const float a2 = hit.alpha_squared;
  const float nv = hit.view_cosine;
  const float smith_v = hit.smith_view;
  const float f0 = hit.f0;
  const float lobe = hit.lobe;
  for (int l = 0; l < stride; ++l) {
    const auto visible = static_cast<float>(visibility[l]);
    const float cosine = nx * lx[l] + ny * ly[l] + nz * lz[l];
    const float nl = cosine > 0.0F ? cosine : 0.0F;
    const float nh = nx * hx[l] + ny * hy[l] + nz * hz[l];
    // pi f_s n.l = F (a2 / d^2) n.l / (2 g): D = a2 / (pi d^2), G2 / (4 n.l n.v) = 1 / (2 g).
    const float d = nh * nh * (a2 - 1.0F) + 1.0F;
    const float g = nl * smith_v + nv * std::sqrt(a2 + (1.0F - a2) * nl * nl);
    const float fresnel = f0 + (1.0F - f0) * schlick[l];
    const float specular = visible * lobe * fresnel * nl / (d * d * g);
    const float received = visible * direct[l];
    sum_r[l] += diffuse_r * (received + indirect_r[l]) + specular;
    sum_g[l] += diffuse_g * (received + indirect_g[l]) + specular;
    sum_b[l] += diffuse_b * (received + indirect_b[l]) + specular;
  }
}

class HeightFieldTracer final : public BtfSource {
 public:
  HeightFieldTracer(SurfaceMaps maps, BtfInfo info, const TraceOptions& options,
                    std::unique_ptr<HeightFieldScene> scene, const SpecularAlbedo& specular,
                    std::vector<Facet> facets, SurfaceLight light)
      : maps_(std::move(maps)),
        info_(std::move(info)),
        options_(options),
        scene_(std::move(scene)),
        specular_(specular),
        facets_(std::move(facets)),
        light_(std::move(light)) {
    const size_t stride = light_.stride();
    lights_ = {std::vector<float>(stride), std::vector<float>(stride), std::vector<float>(stride, -1.0F)};
    for (size_t l = 0; l < info_.lights.size(); ++l) {
      const Eigen::Vector3d wi = VectorFromDirection(info_.lights[l]);
      lights_.x[l] = static_cast<float>(wi.x());
      lights_.y[l] = static_cast<float>(wi.y());
      lights_.z[l] = static_cast<float>(wi.z());
    }
    for (const Direction& view : info_.views) {
      ViewTables& tables = views_.emplace_back();
      tables.direction = VectorFromDirection(view);
      for (auto* table : {&tables.half_x, &tables.half_y, &tables.half_z, &tables.schlick}) {
        table->resize(stride);
      }
      for (size_t l = 0; l < info_.lights.size(); ++l) {
        const Eigen::Vector3d half = (tables.direction + VectorFromDirection(info_.lights[l])).normalized();
        tables.half_x[l] = static_cast<float>(half.x());
        tables.half_y[l] = static_cast<float>(half.y());
        tables.half_z[l] = static_cast<float>(half.z());
        tables.schlick[l] = static_cast<float>(std::pow(1.0 - std::min(1.0, half.dot(tables.direction)), 5));
      }
    }
  }

  [[nodiscard]] const BtfInfo& info() const override { return info_; }

  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override {
    if (row_begin < 0 || num_rows < 0 || num_rows > info_.height - row_begin) {
      return absl::InvalidArgumentError("rows [" + std::to_string(row_begin) + ", +" +
                                        std::to_string(num_rows) + "): the BTF has " +
                                        std::to_string(info_.height));
    }
    if (samples.size() != static_cast<size_t>(num_rows) * SamplesPerRow()) {
      return absl::InvalidArgumentError("buffer of " + std::to_string(samples.size()) +
                                        " samples, expected " +
                                        std::to_string(static_cast<size_t>(num_rows) * SamplesPerRow()));
    }
    const size_t texel_samples = SamplesPerRow() / info_.width;
    ParallelFor(context, 0, int64_t{num_rows} * info_.width, kTexelGrain, [&](int64_t begin, int64_t end) {
      std::vector<float> sums(static_cast<size_t>(3) * light_.stride());
      for (int64_t texel = begin; texel < end; ++texel) {
        TraceTexel(static_cast<int>(texel % info_.width), row_begin + static_cast<int>(texel / info_.width),
                   sums, samples.data() + texel * texel_samples);
      }
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    context.Report("rows", row_begin + num_rows, info_.height, "rows");
    return absl::OkStatus();
  }

 private:
  // Fills `out` [3][view][light] of one texel. `sums` is scratch, [3][stride].
  void TraceTexel(int x, int row, std::span<float> sums, float* out) const;
  // Adds one hit seen along view `tables` to sums [3][stride].
  void AddHit(int64_t facet_index, int part, const ViewTables& tables, float* sums) const;

  const SurfaceMaps maps_;
  const BtfInfo info_;
  const TraceOptions options_;
  const std::unique_ptr<HeightFieldScene> scene_;
  const SpecularAlbedo& specular_;
  const std::vector<Facet> facets_;
  const SurfaceLight light_;
  LightTables lights_;
  std::vector<ViewTables> views_;
};

void HeightFieldTracer::TraceTexel(int x, int row, std::span<float> sums, float* out) const {
  const size_t num_views = views_.size();
  const size_t num_lights = info_.lights.size();
  const size_t stride = light_.stride();
  for (size_t view = 0; view < num_views; ++view) {
    const ViewTables& tables = views_[view];
    const Eigen::Vector3d& wo = tables.direction;
    // Hammersley points, turned around the texel's torus by a shift of the texel's and view's own.
    Rng rng(Mix64(options_.seed, (static_cast<uint64_t>(row) * info_.width + x) * num_views + view));
    const double shift_x = rng.NextDouble();
    const double shift_y = rng.NextDouble();
    const double rise = (scene_->highest() + kClearance) / wo.z();
    std::fill(sums.begin(), sums.end(), 0.0F);
    int num_hits = 0;
    for (int first = 0; first < options_.area_samples; first += kPacketSize) {
      RayPacket rays;
      rays.dx.fill(static_cast<float>(-wo.x()));
      rays.dy.fill(static_cast<float>(-wo.y()));
      rays.dz.fill(static_cast<float>(-wo.z()));
      const int lanes = std::min(kPacketSize, options_.area_samples - first);
      for (int lane = 0; lane < lanes; ++lane) {
        const int sample = first + lane;
        const double u = (sample + 0.5) / options_.area_samples + shift_x;
        const double v = RadicalInverse2(sample) + shift_y;
        const double px = x + u - std::floor(u) + rise * wo.x();
        const double py = info_.height - row - (v - std::floor(v)) + rise * wo.y();
        rays.x[lane] = static_cast<float>(px - info_.width * std::floor(px / info_.width));
        rays.y[lane] = static_cast<float>(py - info_.height * std::floor(py / info_.height));
        rays.z[lane] = static_cast<float>(rise * wo.z());
        rays.active[lane] = true;
      }
      HitPacket hits;
      scene_->Intersect(rays, RayKind::kCoherent, hits);
      for (int lane = 0; lane < lanes; ++lane) {
        if (hits.facet[lane] >= 0) {
          AddHit(hits.facet[lane], light_.parts().PartAt(hits.u[lane], hits.v[lane]), tables, sums.data());
          ++num_hits;
        }
      }
    }
    // A downward ray always meets the endless field; were one lost to rounding, it must not darken the texel.
    const float scale = 1.0F / static_cast<float>(std::max(1, num_hits));
    for (int c = 0; c < 3; ++c) {
      float* const values = out + (c * num_views + view) * num_lights;
      const float* const sum = sums.data() + c * stride;
      for (size_t l = 0; l < num_lights; ++l) {
        values[l] = sum[l] * scale;
      }
    }
  }
}

void HeightFieldTracer::AddHit(int64_t facet_index, int part, const ViewTables& tables, float* sums) const {
  const Facet& facet = facets_[facet_index];
  const int stride = light_.stride();
  const float nv = std::max(kMinViewCosine, facet.normal.dot(tables.direction.cast<float>().eval()));
  const float left_over = 1.0F - specular_.Directional(nv, facet.roughness, maps_.specular_f0);
  const float a2 = facet.alpha_squared;
  const HitTerms hit{
      .normal = {facet.normal.x(), facet.normal.y(), facet.normal.z()},
      .diffuse = {facet.diffuse[0] * left_over, facet.diffuse[1] * left_over, facet.diffuse[2] * left_over},
      .view_cosine = nv,
      .alpha_squared = a2,
      .smith_view = std::sqrt(a2 + (1.0F - a2) * nv * nv),
      .f0 = maps_.specular_f0,
      .lobe = maps_.specular_f0 > 0.0F ? 0.5F * a2 : 0.0F};
  const float* indirect = light_.Indirect(facet_index);
  AddLights(hit, stride, light_.Visibility(facet_index, part), light_.Direct(facet_index), indirect,
            indirect + stride, indirect + 2 * static_cast<size_t>(stride), lights_.x.data(), lights_.y.data(),
            lights_.z.data(), tables.half_x.data(), tables.half_y.data(), tables.half_z.data(),
            tables.schlick.data(), sums, sums + stride, sums + 2 * static_cast<size_t>(stride));
}

}  // namespace

int EdgePartsFor(int area_samples, int cells_per_texel) {
  int parts = 1;
  while (2 * cells_per_texel * cells_per_texel * parts * parts < area_samples) {
    ++parts;
  }
  return parts;
}

absl::StatusOr<std::unique_ptr<BtfSource>> TraceHeightField(SurfaceMaps maps, BtfInfo info,
                                                            const TraceOptions& options,
                                                            const RunContext& context) {
  auto scene = HeightFieldScene::Create(maps);
  if (!scene.ok()) {
    return scene.status();
  }
  static const SpecularAlbedo specular;  // the same for every surface
  std::vector<Facet> facets = MakeFacets(maps, specular);
  std::vector<Eigen::Vector3d> lights;
  for (const Direction& light : info.lights) {
    lights.push_back(VectorFromDirection(light));
  }
  const SurfaceLight::Options light_options{
      .bounces = options.bounces,
      .edge_parts = EdgePartsFor(options.area_samples, maps.cells_per_texel),
      .seed = Mix64(options.seed, 1)};
  auto light = SurfaceLight::Solve(maps, facets, **scene, specular, lights, light_options, context);
  if (!light.ok()) {
    return light.status();
  }
  return std::make_unique<HeightFieldTracer>(std::move(maps), std::move(info), options, *std::move(scene),
                                             specular, std::move(facets), *std::move(light));
}

}  // namespace tessera
