// Sharp edges of a closed triangle mesh, and the points where they end or meet.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/remesh/closest_point.h"

namespace tessera {

struct Creases {
  std::optional<ClosestPoint> lines;  // segments as flat triangles; none without creases
  std::vector<Eigen::Vector3d> corners;
};

// Edges whose triangles' normals differ by more than `least_angle_rad`, in connected pieces of at least
// `least_length`: shorter ones are noise of the scan. Corners are vertices where other than two such edges
// meet, or two at a right angle or sharper. `surface` is made of the same mesh. Errors: INTERNAL when Embree
// fails.
[[nodiscard]] absl::StatusOr<Creases> FindCreases(const std::vector<Eigen::Vector3d>& positions,
                                                  std::span<const Triangle> triangles,
                                                  const ClosestPoint& surface, double least_angle_rad,
                                                  double least_length);

}  // namespace tessera
