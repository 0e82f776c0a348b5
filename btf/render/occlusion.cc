#include "btf/render/occlusion.h"

#include <algorithm>
#include <cstdint>
#include <utility>

#include <absl/strings/str_cat.h>
#include <tbb/task_arena.h>

#include "btf/base/embree_scene.h"
#include "btf/base/status_macros.h"

namespace tessera {

struct Occlusion::Embree : EmbreeScene {};

Occlusion::Occlusion(std::unique_ptr<Embree> embree) : embree_(std::move(embree)) {}
Occlusion::~Occlusion() = default;

absl::StatusOr<std::unique_ptr<Occlusion>> Occlusion::Create(const SurfaceTriangles& triangles) {
  auto embree = std::make_unique<Embree>();
  TESSERA_RETURN_IF_ERROR(embree->OpenDevice());
  const RTCDevice device = embree->device;
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), triangles.vertices.size()));
  auto* indices =
      static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                     3 * sizeof(uint32_t), triangles.indices.size() / 3));
  if (vertices == nullptr || indices == nullptr) {
    rtcReleaseGeometry(geometry);
    return absl::InternalError(
        absl::StrCat("Embree: no memory for ", triangles.vertices.size(), " vertices"));
  }
  for (const SurfaceVertex& vertex : triangles.vertices) {
    vertices = std::copy_n(vertex.position.data(), 3, vertices);
  }
  std::ranges::copy(triangles.indices, indices);
  embree->scene = rtcNewScene(device);
  const RTCScene scene = embree->scene;
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);  // watertight across the edges of triangles
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  tbb::task_arena(1).execute([&] { rtcCommitScene(scene); });
  if (const RTCError error = rtcGetDeviceError(device); error != RTC_ERROR_NONE) {
    return absl::InternalError(
        absl::StrCat("Embree: building the scene failed with error ", static_cast<int>(error)));
  }
  return std::unique_ptr<Occlusion>(new Occlusion(std::move(embree)));
}

bool Occlusion::Occludes(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                         double length) const {
  RTCRay ray{};
  ray.org_x = static_cast<float>(origin.x());
  ray.org_y = static_cast<float>(origin.y());
  ray.org_z = static_cast<float>(origin.z());
  ray.dir_x = static_cast<float>(direction.x());
  ray.dir_y = static_cast<float>(direction.y());
  ray.dir_z = static_cast<float>(direction.z());
  ray.tfar = static_cast<float>(length);
  ray.mask = ~0U;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(embree_->scene, &context, &ray);
  // Embree says so by a negative length.
  return ray.tfar < 0.0F;
}

}  // namespace tessera
