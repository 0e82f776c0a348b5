#include "btf/meso/height_field_scene.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include <absl/status/status.h>
#include <tbb/task_arena.h>

#include "btf/base/embree_scene.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace {

// Width of the copied border, texels. A ray that leaves it goes on from kStepBack before the place where it
// left, so that the two stretches overlap and no border facet can be missed between them.
constexpr float kMargin = 2.0F;
constexpr float kStepBack = 1.0F;
// Rays below the smallest polar elevation of GenerateParams (1 degree) would run longer than this many
// periods; they count as leaving. At a height range of size / 4 and 1 degree a ray crosses 15 periods.
constexpr int kMaxPeriods = 64;

float WrapInto(float x, float size) {
  const float wrapped = x - size * std::floor(x / size);
  return wrapped < size ? wrapped : 0.0F;
}

int WrapIndex(int i, int n) {
  const int wrapped = i % n;
  return wrapped < 0 ? wrapped + n : wrapped;
}

}  // namespace

struct HeightFieldScene::Embree : EmbreeScene {};

HeightFieldScene::HeightFieldScene(std::unique_ptr<Embree> embree) : embree_(std::move(embree)) {}
HeightFieldScene::~HeightFieldScene() = default;

absl::StatusOr<std::unique_ptr<HeightFieldScene>> HeightFieldScene::Create(const SurfaceMaps& maps) {
  auto embree = std::make_unique<Embree>();
  TESSERA_RETURN_IF_ERROR(embree->OpenDevice());
  const RTCDevice device = embree->device;
  std::unique_ptr<HeightFieldScene> result(new HeightFieldScene(std::move(embree)));
  const int n = maps.resolution();
  const int margin = static_cast<int>(std::ceil(kMargin * static_cast<float>(maps.cells_per_texel)));
  const int cells = n + 2 * margin;
  result->size_ = static_cast<float>(maps.size);
  result->resolution_ = n;
  result->margin_cells_ = margin;
  const auto [low, high] = std::minmax_element(maps.height.begin(), maps.height.end());
  result->lowest_ = *low;
  result->highest_ = *high;

  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const size_t num_vertices = static_cast<size_t>(cells + 1) * (cells + 1);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), num_vertices));
  auto* triangles = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0,
                                                                   RTC_FORMAT_UINT3, 3 * sizeof(uint32_t),
                                                                   static_cast<size_t>(2) * cells * cells));
  if (vertices == nullptr || triangles == nullptr) {
    rtcReleaseGeometry(geometry);
    return absl::InternalError("Embree: no memory for " + std::to_string(num_vertices) + " vertices");
  }
  for (int row = 0; row <= cells; ++row) {
    for (int column = 0; column <= cells; ++column) {
      const int i = WrapIndex(column - margin, n);
      const int j = WrapIndex(row - margin, n);
      *vertices++ = static_cast<float>(column - margin) / static_cast<float>(maps.cells_per_texel);
      *vertices++ = static_cast<float>(maps.size) -
                    static_cast<float>(row - margin) / static_cast<float>(maps.cells_per_texel);
      *vertices++ = maps.height[static_cast<size_t>(j) * n + i];
    }
  }
  for (int row = 0; row < cells; ++row) {
    for (int column = 0; column < cells; ++column) {
      for (int k = 0; k < 2; ++k) {
        const FacetCorners corners =
            CornersOfFacet(WrapIndex(column - margin, n), WrapIndex(row - margin, n), k);
        for (const auto& corner : corners) {
          *triangles++ = static_cast<uint32_t>(row + corner[1]) * (cells + 1) + (column + corner[0]);
        }
      }
    }
  }
  const RTCScene scene = rtcNewScene(device);
  result->embree_->scene = scene;
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);  // watertight across the edges of facets
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  // A parallel build may order leaves differently from run to run, and ties on shared edges with them.
  tbb::task_arena(1).execute([&] { rtcCommitScene(scene); });
  if (const RTCError error = rtcGetDeviceError(device); error != RTC_ERROR_NONE) {
    return absl::InternalError("Embree: building the scene failed with error " + std::to_string(error));
  }
  return result;
}

// Calls trace(packet, mask, far) for one stretch after the other; `trace` clears the mask of lanes that are
// decided. `far` holds each lane's length of the stretch.
template <typename Trace>
void HeightFieldScene::TraceWrapped(const RayPacket& rays, const Trace& trace) const {
  RayPacket stretch = rays;
  alignas(32) std::array<int, kPacketSize> valid{};
  alignas(32) std::array<float, kPacketSize> leaves{};  // where the padded period ends
  std::array<float, kPacketSize> remaining{};           // where the slab ends
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  bool any = false;
  for (int lane = 0; lane < kPacketSize; ++lane) {
    valid[lane] = rays.active[lane] ? -1 : 0;
    any |= rays.active[lane];
    stretch.x[lane] = WrapInto(rays.x[lane], size_);
    stretch.y[lane] = WrapInto(rays.y[lane], size_);
    remaining[lane] =
        rays.dz[lane] > 0.0F ? std::max(0.0F, highest_ - rays.z[lane]) / rays.dz[lane] : kInfinity;
  }
  for (int period = 0; any && period < kMaxPeriods; ++period) {
    for (int lane = 0; lane < kPacketSize; ++lane) {
      const auto exit = [&](float o, float d) {
        return d > 0.0F ? (size_ + kMargin - o) / d : d < 0.0F ? (-kMargin - o) / d : kInfinity;
      };
      leaves[lane] =
          std::min(exit(stretch.x[lane], stretch.dx[lane]), exit(stretch.y[lane], stretch.dy[lane]));
    }
    trace(stretch, valid);
    any = false;
    for (int lane = 0; lane < kPacketSize; ++lane) {
      if (valid[lane] == 0) {
        continue;
      }
      if (!(leaves[lane] < remaining[lane])) {
        valid[lane] = 0;
        continue;
      }
      const float advance = leaves[lane] - kStepBack;
      stretch.x[lane] = WrapInto(stretch.x[lane] + advance * stretch.dx[lane], size_);
      stretch.y[lane] = WrapInto(stretch.y[lane] + advance * stretch.dy[lane], size_);
      stretch.z[lane] += advance * stretch.dz[lane];
      remaining[lane] -= advance;
      any = true;
    }
  }
}

void HeightFieldScene::Intersect(const RayPacket& rays, RayKind kind, HitPacket& hits) const {
  hits.facet.fill(-1);
  const int n = resolution_;
  const int cells = n + 2 * margin_cells_;
  TraceWrapped(rays, [&](const RayPacket& stretch, std::array<int, kPacketSize>& valid) {
    RTCRayHit8 packet;
    for (int lane = 0; lane < kPacketSize; ++lane) {
      packet.ray.org_x[lane] = stretch.x[lane];
      packet.ray.org_y[lane] = stretch.y[lane];
      packet.ray.org_z[lane] = stretch.z[lane];
      packet.ray.dir_x[lane] = stretch.dx[lane];
      packet.ray.dir_y[lane] = stretch.dy[lane];
      packet.ray.dir_z[lane] = stretch.dz[lane];
      packet.ray.tnear[lane] = 0.0F;
      packet.ray.tfar[lane] = std::numeric_limits<float>::infinity();
      packet.ray.time[lane] = 0.0F;
      packet.ray.mask[lane] = ~0U;
      packet.ray.id[lane] = 0;
      packet.ray.flags[lane] = 0;
      packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = kind == RayKind::kCoherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                               : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    rtcIntersect8(valid.data(), embree_->scene, &context, &packet);
    for (int lane = 0; lane < kPacketSize; ++lane) {
      if (valid[lane] == 0 || packet.hit.geomID[lane] == RTC_INVALID_GEOMETRY_ID) {
        continue;
      }
      valid[lane] = 0;
      const int cell = static_cast<int>(packet.hit.primID[lane] / 2);
      const int i = WrapIndex(cell % cells - margin_cells_, n);
      const int j = WrapIndex(cell / cells - margin_cells_, n);
      hits.facet[lane] = 2 * (static_cast<int64_t>(j) * n + i) + packet.hit.primID[lane] % 2;
      hits.u[lane] = packet.hit.u[lane];
      hits.v[lane] = packet.hit.v[lane];
    }
  });
}

std::array<bool, kPacketSize> HeightFieldScene::Occluded(const RayPacket& rays, RayKind kind) const {
  std::array<bool, kPacketSize> occluded{};
  TraceWrapped(rays, [&](const RayPacket& stretch, std::array<int, kPacketSize>& valid) {
    RTCRay8 packet;
    for (int lane = 0; lane < kPacketSize; ++lane) {
      packet.org_x[lane] = stretch.x[lane];
      packet.org_y[lane] = stretch.y[lane];
      packet.org_z[lane] = stretch.z[lane];
      packet.dir_x[lane] = stretch.dx[lane];
      packet.dir_y[lane] = stretch.dy[lane];
      packet.dir_z[lane] = stretch.dz[lane];
      packet.tnear[lane] = 0.0F;
      packet.tfar[lane] = std::numeric_limits<float>::infinity();
      packet.time[lane] = 0.0F;
      packet.mask[lane] = ~0U;
      packet.id[lane] = 0;
      packet.flags[lane] = 0;
    }
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = kind == RayKind::kCoherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT
                                               : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    rtcOccluded8(valid.data(), embree_->scene, &context, &packet);
    for (int lane = 0; lane < kPacketSize; ++lane) {
      if (valid[lane] != 0 && packet.tfar[lane] < 0.0F) {  // Embree marks an occluded ray by tfar = -inf
        occluded[lane] = true;
        valid[lane] = 0;
      }
    }
  });
  return occluded;
}

}  // namespace tessera
