// Closest points on triangles, by Embree's point queries.
//
//   TESSERA_ASSIGN_OR_RETURN(ClosestPoint surface, ClosestPoint::Create(positions, triangles));
//   SurfacePoint at = surface.Find(p);
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/remesh/triangle_mesh.h"

namespace tessera {

struct SurfacePoint {
  uint32_t triangle = 0;
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();  // weights of the triangle's corners
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  double distance = 0.0;
};

// Safe to ask from several threads at once.
class ClosestPoint {
 public:
  // Triangles may be flat or stand for segments (a, b, b). There is at least one. Coordinates are of the
  // order of 1. Errors: INTERNAL when Embree fails.
  [[nodiscard]] static absl::StatusOr<ClosestPoint> Create(std::vector<Eigen::Vector3d> positions,
                                                           std::vector<Triangle> triangles);
  ClosestPoint(ClosestPoint&&) noexcept;
  ClosestPoint& operator=(ClosestPoint&&) noexcept;
  ~ClosestPoint();

  // The closest point; of equally close ones that of the lowest triangle.
  [[nodiscard]] SurfacePoint Find(const Eigen::Vector3d& p) const;
  // The closest point on triangles whose normal is within 120 degrees of the unit vector `facing`; Find's
  // when all face away. It keeps a point from being drawn through a thin part to its other side.
  [[nodiscard]] SurfacePoint FindFacing(const Eigen::Vector3d& p, const Eigen::Vector3d& facing) const;

  // Unit normals, 0 of flat triangles.
  [[nodiscard]] const std::vector<Eigen::Vector3d>& normals() const { return normals_; }

 private:
  struct Embree;
  struct Query;
  explicit ClosestPoint(std::unique_ptr<Embree> embree);
  [[nodiscard]] SurfacePoint Search(const Eigen::Vector3d& p, const Eigen::Vector3d* facing) const;

  std::unique_ptr<Embree> embree_;
  std::vector<Eigen::Vector3d> positions_;
  std::vector<Triangle> triangles_;
  std::vector<Eigen::Vector3d> normals_;
};

}  // namespace tessera
