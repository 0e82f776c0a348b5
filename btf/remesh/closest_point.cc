#include "btf/remesh/closest_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <absl/status/status.h>
#include <tbb/task_arena.h>
#include <Eigen/Geometry>

#include "btf/base/embree_scene.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace {

// Embree prunes in float32; this much slack keeps every triangle that is as close as the best one in the
// search, so that ties are broken by index and not by the order of the tree.
constexpr double kSlack = 1e-5;

// Cosine of the angle to the wanted direction from which a triangle faces away. Beyond 90 degrees, so that
// both sides of a sharp rim may be reached from it.
constexpr double kFacingAway = -0.5;

// Closest point on a triangle by the regions of its corners, sides and face: the barycentric weights.
Eigen::Vector3d ClosestBarycentric(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const std::array<const Eigen::Vector3d*, 3> corners{&a, &b, &c};
  const Eigen::Vector3d normal = (b - a).cross(c - a);
  const double twice_area_squared = normal.squaredNorm();
  if (twice_area_squared > 0.0) {
    const double weight_b = (p - a).cross(c - a).dot(normal) / twice_area_squared;
    const double weight_c = (b - a).cross(p - a).dot(normal) / twice_area_squared;
    if (weight_b >= 0.0 && weight_c >= 0.0 && weight_b + weight_c <= 1.0) {
      return {1.0 - weight_b - weight_c, weight_b, weight_c};
    }
  }
  // Outside of the prism over the triangle the closest point lies on a side.
  double best_squared = std::numeric_limits<double>::infinity();
  Eigen::Vector3d best = Eigen::Vector3d::UnitX();
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d& from = *corners[k];
    const Eigen::Vector3d along = *corners[(k + 1) % 3] - from;
    const double length_squared = along.squaredNorm();
    const double t =
        length_squared > 0.0 ? std::clamp((p - from).dot(along) / length_squared, 0.0, 1.0) : 0.0;
    const double squared = (p - from - t * along).squaredNorm();
    if (squared < best_squared) {
      best_squared = squared;
      best.setZero();
      best[k] = 1.0 - t;
      best[(k + 1) % 3] = t;
    }
  }
  return best;
}

}  // namespace

struct ClosestPoint::Embree : EmbreeScene {};

struct ClosestPoint::Query {
  const ClosestPoint* self = nullptr;
  Eigen::Vector3d p;
  const Eigen::Vector3d* facing = nullptr;
  SurfacePoint best;

  static bool Visit(RTCPointQueryFunctionArguments* arguments);
};

bool ClosestPoint::Query::Visit(RTCPointQueryFunctionArguments* arguments) {
  auto& query = *static_cast<Query*>(arguments->userPtr);
  const uint32_t index = arguments->primID;
  const ClosestPoint& self = *query.self;
  if (query.facing != nullptr && self.normals_[index].dot(*query.facing) < kFacingAway) {
    return false;
  }
  const Triangle& triangle = self.triangles_[index];
  const Eigen::Vector3d& a = self.positions_[triangle[0]];
  const Eigen::Vector3d& b = self.positions_[triangle[1]];
  const Eigen::Vector3d& c = self.positions_[triangle[2]];
  const Eigen::Vector3d weights = ClosestBarycentric(query.p, a, b, c);
  const Eigen::Vector3d position = weights[0] * a + weights[1] * b + weights[2] * c;
  const double distance = (position - query.p).norm();
  SurfacePoint& best = query.best;
  if (distance < best.distance || (distance == best.distance && index < best.triangle)) {
    best = {index, weights, position, distance};
    arguments->query->radius =
        std::min(arguments->query->radius, static_cast<float>(distance * (1.0 + kSlack) + kSlack * kSlack));
    return true;
  }
  return false;
}

ClosestPoint::ClosestPoint(std::unique_ptr<Embree> embree) : embree_(std::move(embree)) {}
ClosestPoint::ClosestPoint(ClosestPoint&&) noexcept = default;
ClosestPoint& ClosestPoint::operator=(ClosestPoint&&) noexcept = default;
ClosestPoint::~ClosestPoint() = default;

absl::StatusOr<ClosestPoint> ClosestPoint::Create(std::vector<Eigen::Vector3d> positions,
                                                  std::vector<Triangle> triangles) {
  auto embree = std::make_unique<Embree>();
  TESSERA_RETURN_IF_ERROR(embree->OpenDevice());
  const RTCDevice device = embree->device;
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), positions.size()));
  auto* indices = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, sizeof(Triangle), triangles.size()));
  if (vertices == nullptr || indices == nullptr) {
    rtcReleaseGeometry(geometry);
    return absl::InternalError("Embree: no memory for " + std::to_string(triangles.size()) + " triangles");
  }
  for (const Eigen::Vector3d& p : positions) {
    Eigen::Map<Eigen::Vector3f>{vertices} = p.cast<float>();
    vertices += 3;
  }
  for (const Triangle& triangle : triangles) {
    indices = std::copy(triangle.begin(), triangle.end(), indices);
  }
  const RTCScene scene = rtcNewScene(device);
  embree->scene = scene;
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  // One thread, so that the tree is the same in every run.
  tbb::task_arena(1).execute([&] { rtcCommitScene(scene); });
  if (const RTCError error = rtcGetDeviceError(device); error != RTC_ERROR_NONE) {
    return absl::InternalError("Embree: building the scene failed with error " + std::to_string(error));
  }
  ClosestPoint result(std::move(embree));
  result.normals_.reserve(triangles.size());
  for (const Triangle& triangle : triangles) {
    const Eigen::Vector3d& a = positions[triangle[0]];
    const Eigen::Vector3d normal = (positions[triangle[1]] - a).cross(positions[triangle[2]] - a);
    const double length = normal.norm();
    result.normals_.push_back(length > 0.0 ? Eigen::Vector3d(normal / length) : Eigen::Vector3d(0, 0, 0));
  }
  result.positions_ = std::move(positions);
  result.triangles_ = std::move(triangles);
  return result;
}

SurfacePoint ClosestPoint::Find(const Eigen::Vector3d& p) const {
  return Search(p, nullptr);
}

SurfacePoint ClosestPoint::FindFacing(const Eigen::Vector3d& p, const Eigen::Vector3d& facing) const {
  const SurfacePoint found = Search(p, &facing);
  return std::isfinite(found.distance) ? found : Search(p, nullptr);
}

SurfacePoint ClosestPoint::Search(const Eigen::Vector3d& p, const Eigen::Vector3d* facing) const {
  Query query;
  query.self = this;
  query.p = p;
  query.facing = facing;
  query.best.distance = std::numeric_limits<double>::infinity();
  RTCPointQuery point_query{};
  point_query.x = static_cast<float>(p.x());
  point_query.y = static_cast<float>(p.y());
  point_query.z = static_cast<float>(p.z());
  point_query.radius = std::numeric_limits<float>::infinity();
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(embree_->scene, &point_query, &context, &Query::Visit, &query);
  return query.best;
}

}  // namespace tessera
