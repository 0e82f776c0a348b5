// Whether anything lies between a point and a light, exactly, with Embree.
#pragma once

#include <memory>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/render/preview_scene.h"

namespace tessera {

// Immutable; thread-safe.
class Occlusion {
 public:
  // Errors: INTERNAL with Embree's code. Cost: a tree over the triangles, by one thread, so that it is the
  // same every time.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<Occlusion>> Create(const SurfaceTriangles& triangles);
  ~Occlusion();

  // Whether a triangle, seen from either side, cuts the ray before `length`. Origin relative to
  // SurfaceTriangles::centre; unit direction; length may be infinite. In single precision.
  [[nodiscard]] bool Occludes(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                              double length) const;

 private:
  struct Embree;
  explicit Occlusion(std::unique_ptr<Embree> embree);

  std::unique_ptr<Embree> embree_;
};

}  // namespace tessera
