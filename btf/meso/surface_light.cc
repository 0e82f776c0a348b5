#include "btf/meso/surface_light.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/math/conventions.h"
#include "btf/meso/progress_counter.h"

namespace tessera {
namespace {

constexpr int kSimdFloats = 8;  // floats of one AVX register; rows of the tables are whole registers

// Rays of one facet. A texel has at least two facets and usually eight, so its irradiance averages over 512.
constexpr int kGatherStrata = 8;
constexpr int kGatherRays = kGatherStrata * kGatherStrata;

// Lights solved at once: [3][kBlock] floats of a facet are three cache lines, and the two buffers of a pass
// stay small next to the result.
constexpr int kBlock = 16;

// Rays start this far above the facet, texels: beyond float's rounding at 1024 texels (6e-5), far below a
// cell.
constexpr float kLift = 1e-3F;

struct Link {
  uint32_t facet = 0;
  float weight = 0.0F;
};

// A frame around a unit normal with z > 0. [Duff2017]
void FrameAround(const Eigen::Vector3f& n, Eigen::Vector3f& t, Eigen::Vector3f& b) {
  const float a = -1.0F / (1.0F + n.z());
  const float xy = n.x() * n.y() * a;
  t = {1.0F + n.x() * n.x() * a, xy, -n.x()};
  b = {xy, 1.0F + n.y() * n.y() * a, -n.y()};
}

}  // namespace

int SurfaceLight::StrideFor(int num_lights) {
  return (num_lights + kSimdFloats - 1) / kSimdFloats * kSimdFloats;
}

double SurfaceLight::PeakBytes(int64_t num_facets, int num_lights, int edge_parts, int bounces) {
  const double stride = StrideFor(num_lights);
  const double tables = stride * (edge_parts * edge_parts + 4 * sizeof(float));
  const double links = bounces > 0 ? kGatherRays * sizeof(Link) + 2 * 3 * kBlock * sizeof(float) : 0;
  constexpr double kSceneBytes = 200;  // Embree's tree and buffers and the facet itself, as measured
  return static_cast<double>(num_facets) * (tables + links + kSceneBytes);
}

SurfaceLight::SurfaceLight(int num_lights, int edge_parts, int64_t num_facets)
    : stride_(StrideFor(num_lights)),
      parts_(edge_parts),
      visibility_(static_cast<size_t>(num_facets) * parts_.count() * stride_),
      direct_(static_cast<size_t>(num_facets) * stride_),
      indirect_(static_cast<size_t>(num_facets) * 3 * stride_) {}

absl::StatusOr<SurfaceLight> SurfaceLight::Solve(const SurfaceMaps& maps, const std::vector<Facet>& facets,
                                                 const HeightFieldScene& scene,
                                                 const SpecularAlbedo& specular,
                                                 const std::vector<Eigen::Vector3d>& lights,
                                                 const Options& options, const RunContext& context) {
  SurfaceLight result(static_cast<int>(lights.size()), options.edge_parts, maps.num_facets());
  TESSERA_RETURN_IF_ERROR(result.SolveDirect(maps, facets, scene, specular, lights, context));
  if (options.bounces > 0) {
    TESSERA_RETURN_IF_ERROR(result.SolveBounces(maps, facets, scene, specular, options, context));
  }
  return result;
}

absl::Status SurfaceLight::SolveDirect(const SurfaceMaps& maps, const std::vector<Facet>& facets,
                                       const HeightFieldScene& scene, const SpecularAlbedo& specular,
                                       const std::vector<Eigen::Vector3d>& lights,
                                       const RunContext& context) {
  const int n = maps.resolution();
  const int num_parts = parts_.count();
  const int64_t points_per_row = int64_t{2} * n * num_parts;
  ProgressCounter progress(context, "visibility", points_per_row * n, "points");
  ParallelFor(context, 0, n, 1, [&](int64_t row_begin, int64_t row_end) {
    std::vector<Eigen::Vector3f> origins(points_per_row);
    for (int64_t j = row_begin; j < row_end; ++j) {
      const int64_t first_facet = 2 * j * n;
      for (int64_t f = 0; f < int64_t{2} * n; ++f) {
        const auto corners =
            CornerPositions(maps, static_cast<int>(f / 2), static_cast<int>(j), static_cast<int>(f % 2));
        for (int part = 0; part < num_parts; ++part) {
          const auto [u, v] = parts_.centroid(part);
          origins[f * num_parts + part] = (1.0F - u - v) * corners[0] + u * corners[1] + v * corners[2] +
                                          kLift * facets[first_facet + f].normal;
        }
      }
      for (size_t l = 0; l < lights.size(); ++l) {
        const Eigen::Vector3f wi = lights[l].cast<float>();
        RayPacket rays;
        rays.dx.fill(wi.x());
        rays.dy.fill(wi.y());
        rays.dz.fill(wi.z());
        std::array<int64_t, kPacketSize> points{};  // of this row
        int lanes = 0;
        const auto flush = [&] {
          for (int lane = 0; lane < kPacketSize; ++lane) {
            rays.active[lane] = lane < lanes;
          }
          const auto occluded = scene.Occluded(rays, RayKind::kCoherent);
          for (int lane = 0; lane < lanes; ++lane) {
            visibility_[(first_facet * num_parts + points[lane]) * stride_ + l] = occluded[lane] ? 0 : 1;
          }
          lanes = 0;
        };
        for (int64_t f = 0; f < int64_t{2} * n; ++f) {
          const Facet& facet = facets[first_facet + f];
          const float cosine = facet.normal.dot(wi);
          if (cosine <= 0.0F) {
            continue;
          }
          direct_[(first_facet + f) * stride_ + l] =
              cosine * (1.0F - specular.Directional(cosine, facet.roughness, maps.specular_f0));
          for (int part = 0; part < num_parts; ++part) {
            const int64_t point = f * num_parts + part;
            rays.x[lanes] = origins[point].x();
            rays.y[lanes] = origins[point].y();
            rays.z[lanes] = origins[point].z();
            points[lanes++] = point;
            if (lanes == kPacketSize) {
              flush();
            }
          }
        }
        if (lanes > 0) {
          flush();
        }
      }
      progress.Add(points_per_row);
    }
  });
  return context.CheckStop();
}

absl::Status SurfaceLight::SolveBounces(const SurfaceMaps& maps, const std::vector<Facet>& facets,
                                        const HeightFieldScene& scene, const SpecularAlbedo& specular,
                                        const Options& options, const RunContext& context) {
  const int n = maps.resolution();
  const int64_t num_facets = maps.num_facets();
  const int num_parts = parts_.count();
  const int num_blocks = (stride_ + kBlock - 1) / kBlock;
  ProgressCounter progress(context, "interreflections", static_cast<uint64_t>(num_facets) * (1 + num_blocks),
                           "points");

  // Where the cosine-distributed rays of each facet land, and what they carry.
  std::vector<Link> links(static_cast<size_t>(num_facets) * kGatherRays);
  std::vector<uint8_t> num_links(num_facets);
  ParallelFor(context, 0, n, 1, [&](int64_t row_begin, int64_t row_end) {
    for (int64_t f = row_begin * 2 * n; f < row_end * 2 * n; ++f) {
      const Facet& facet = facets[f];
      const auto corners = CornerPositions(maps, static_cast<int>(f / 2 % n), static_cast<int>(f / 2 / n),
                                           static_cast<int>(f % 2));
      Eigen::Vector3f tangent;
      Eigen::Vector3f bitangent;
      FrameAround(facet.normal, tangent, bitangent);
      Rng rng(Mix64(options.seed, static_cast<uint64_t>(f)));
      const auto uniform = [&] { return static_cast<float>(rng.NextDouble()); };
      Link* const own = links.data() + f * kGatherRays;
      int count = 0;
      for (int first = 0; first < kGatherRays; first += kPacketSize) {
        RayPacket rays;
        std::array<float, kPacketSize> cosines{};
        for (int lane = 0; lane < kPacketSize; ++lane) {
          const int stratum = first + lane;
          const float a = (static_cast<float>(stratum % kGatherStrata) + uniform()) / kGatherStrata;
          const float b = (static_cast<float>(stratum / kGatherStrata) + uniform()) / kGatherStrata;
          const float phi = static_cast<float>(2.0 * kPi) * a;
          const float radius = std::sqrt(b);
          cosines[lane] = std::sqrt(std::max(0.0F, 1.0F - b));
          const Eigen::Vector3f direction = radius * std::cos(phi) * tangent +
                                            radius * std::sin(phi) * bitangent + cosines[lane] * facet.normal;
          float u = uniform();
          float v = uniform();
          if (u + v > 1.0F) {
            u = 1.0F - u;
            v = 1.0F - v;
          }
          const Eigen::Vector3f origin =
              (1.0F - u - v) * corners[0] + u * corners[1] + v * corners[2] + kLift * facet.normal;
          rays.x[lane] = origin.x();
          rays.y[lane] = origin.y();
          rays.z[lane] = origin.z();
          rays.dx[lane] = direction.x();
          rays.dy[lane] = direction.y();
          rays.dz[lane] = direction.z();
          rays.active[lane] = true;
        }
        HitPacket hits;
        scene.Intersect(rays, RayKind::kScattered, hits);
        for (int lane = 0; lane < kPacketSize; ++lane) {
          if (hits.facet[lane] < 0) {
            continue;
          }
          const Facet& other = facets[hits.facet[lane]];
          const float cosine_there =
              -other.normal.dot(Eigen::Vector3f(rays.dx[lane], rays.dy[lane], rays.dz[lane]));
          own[count++] = {static_cast<uint32_t>(hits.facet[lane]),
                          (1.0F - specular.Directional(cosines[lane], facet.roughness, maps.specular_f0)) *
                              (1.0F - specular.Directional(cosine_there, other.roughness, maps.specular_f0)) /
                              kGatherRays};
        }
      }
      num_links[f] = static_cast<uint8_t>(count);
    }
    progress.Add(static_cast<uint64_t>(row_end - row_begin) * 2 * n);
  });

  // One block of lights at a time: emission [facet][3][kBlock] = diffuse (D + I).
  using Emission = std::array<std::array<float, kBlock>, 3>;
  std::vector<Emission> emission(num_facets);
  std::vector<Emission> next(num_facets);
  for (int begin = 0; begin < stride_; begin += kBlock) {
    const int width = std::min(kBlock, stride_ - begin);
    const auto emit = [&](int64_t f, Emission& out) {
      std::array<float, kBlock> direct{};
      for (int part = 0; part < num_parts; ++part) {
        const uint8_t* visible = Visibility(f, part) + begin;
        for (int l = 0; l < width; ++l) {
          direct[l] += static_cast<float>(visible[l]);
        }
      }
      for (int l = 0; l < width; ++l) {
        direct[l] *= Direct(f)[begin + l] / static_cast<float>(num_parts);
      }
      for (int c = 0; c < 3; ++c) {
        const float* indirect = Indirect(f) + c * stride_ + begin;
        out[c].fill(0.0F);
        for (int l = 0; l < width; ++l) {
          out[c][l] = facets[f].diffuse[c] * (direct[l] + indirect[l]);
        }
      }
    };
    ParallelFor(context, 0, num_facets, 2 * n, [&](int64_t first, int64_t last) {
      for (int64_t f = first; f < last; ++f) {
        emit(f, emission[f]);
      }
    });
    for (int bounce = 0; bounce < options.bounces; ++bounce) {
      ParallelFor(context, 0, num_facets, 2 * n, [&](int64_t first, int64_t last) {
        for (int64_t f = first; f < last; ++f) {
          Emission sum{};
          const Link* const own = links.data() + f * kGatherRays;
          for (int i = 0; i < num_links[f]; ++i) {
            const Emission& other = emission[own[i].facet];
            for (int c = 0; c < 3; ++c) {
              for (int l = 0; l < kBlock; ++l) {
                sum[c][l] += own[i].weight * other[c][l];
              }
            }
          }
          for (int c = 0; c < 3; ++c) {
            std::copy_n(sum[c].data(), width, indirect_.data() + (f * 3 + c) * stride_ + begin);
          }
          if (bounce + 1 < options.bounces) {
            emit(f, next[f]);
          }
        }
      });
      std::swap(emission, next);
      TESSERA_RETURN_IF_ERROR(context.CheckStop());
    }
    progress.Add(num_facets);
  }
  return context.CheckStop();
}

}  // namespace tessera
