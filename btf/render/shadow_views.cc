#include "btf/render/shadow_views.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace tessera {
namespace {

// Room about the bounding sphere, for the bias and for the map's outermost texels.
constexpr double kSphereMargin = 1.02;
// What is nearer to a point light inside the sphere than this share of its radius casts no shadow.
constexpr double kNearestOccluder = 1e-3;

// World to view: rows right, up, back; the view looks along -back from `eye`.
Eigen::Matrix4d ViewMatrix(const Eigen::Vector3d& eye, const Eigen::Vector3d& back) {
  const Eigen::Vector3d aside =
      std::abs(back.x()) < 0.6 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  const Eigen::Vector3d right = aside.cross(back).normalized();
  Eigen::Matrix4d view = Eigen::Matrix4d::Identity();
  view.block<1, 3>(0, 0) = right.transpose();
  view.block<1, 3>(1, 0) = back.cross(right).transpose();
  view.block<1, 3>(2, 0) = back.transpose();
  view.block<3, 1>(0, 3) = -view.block<3, 3>(0, 0) * eye;
  return view;
}

Eigen::Matrix4d Orthographic(double half_width, double near, double far) {
  Eigen::Matrix4d clip = Eigen::Matrix4d::Identity();
  clip(0, 0) = 1.0 / half_width;
  clip(1, 1) = 1.0 / half_width;
  clip(2, 2) = -2.0 / (far - near);
  clip(2, 3) = -(far + near) / (far - near);
  return clip;
}

Eigen::Matrix4d Perspective(double tan_half_width, double near, double far) {
  Eigen::Matrix4d clip = Eigen::Matrix4d::Zero();
  clip(0, 0) = 1.0 / tan_half_width;
  clip(1, 1) = 1.0 / tan_half_width;
  clip(2, 2) = -(far + near) / (far - near);
  clip(2, 3) = -2.0 * far * near / (far - near);
  clip(3, 2) = -1.0;
  return clip;
}

}  // namespace

std::vector<ShadowView> ShadowViewsOf(const Light& light, const SurfaceTriangles& triangles, int map_size) {
  const double radius = kSphereMargin * std::max(triangles.radius, 1e-9);
  if (light.kind == Light::Kind::kDirectional) {
    const Eigen::Vector3d to_light = light.place.normalized();
    return {{.clip_from_surface =
                 Orthographic(radius, 0.0, 2.0 * radius) * ViewMatrix(radius * to_light, to_light),
             .texel_width = 2.0 * radius / map_size}};
  }
  const Eigen::Vector3d eye = light.place - triangles.centre;
  const double distance = eye.norm();
  if (distance >= kOneMapDistance * radius) {
    const double tan_half = radius / std::sqrt(distance * distance - radius * radius);
    return {{.clip_from_surface = Perspective(tan_half, distance - radius, distance + radius) *
                                  ViewMatrix(eye, eye / distance),
             .texel_width = 2.0 * tan_half / map_size}};
  }
  std::vector<ShadowView> views;
  const Eigen::Matrix4d clip = Perspective(1.0, kNearestOccluder * radius, distance + radius);
  for (int side = 0; side < kMostMapsPerLight; ++side) {
    const Eigen::Vector3d back = (side % 2 == 0 ? -1.0 : 1.0) * Eigen::Vector3d::Unit(side / 2);
    views.push_back({.clip_from_surface = clip * ViewMatrix(eye, back), .texel_width = 2.0 / map_size});
  }
  return views;
}

}  // namespace tessera
