#include "viewer/orbit_camera.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace tessera::viewer {
namespace {

constexpr double kMostElevationRad = RadFromDeg(89.0);
constexpr double kZoomPerStep = 0.9;
constexpr double kNearestFactor = 0.05;
constexpr double kFarthestFactor = 20.0;

}  // namespace

OrbitCamera::OrbitCamera(const tessera::Camera& framing)
    : target_(framing.target), fov_y_rad_(framing.fov_y_rad) {
  const Eigen::Vector3d back = framing.eye - framing.target;
  distance_ = framing_distance_ = std::max(back.norm(), 1e-9);
  azimuth_rad_ = std::atan2(back.x(), back.z());
  elevation_rad_ = std::asin(std::clamp(back.y() / distance_, -1.0, 1.0));
}

void OrbitCamera::Orbit(double right_px, double down_px, int height_px) {
  const double rad_per_px = kPi / std::max(height_px, 1);
  azimuth_rad_ = std::remainder(azimuth_rad_ - right_px * rad_per_px, 2.0 * kPi);
  elevation_rad_ = std::clamp(elevation_rad_ + down_px * rad_per_px, -kMostElevationRad, kMostElevationRad);
}

void OrbitCamera::Pan(double right_px, double down_px, int height_px) {
  const double per_px = 2.0 * distance_ * std::tan(0.5 * fov_y_rad_) / std::max(height_px, 1);
  const Eigen::Vector3d back = Back();
  const Eigen::Vector3d right = Eigen::Vector3d::UnitY().cross(back).normalized();
  target_ += per_px * (down_px * back.cross(right) - right_px * right);
}

void OrbitCamera::Zoom(double steps) {
  distance_ = std::clamp(distance_ * std::pow(kZoomPerStep, steps), kNearestFactor * framing_distance_,
                         kFarthestFactor * framing_distance_);
}

Eigen::Vector3d OrbitCamera::Back() const {
  const double c = std::cos(elevation_rad_);
  return {c * std::sin(azimuth_rad_), std::sin(elevation_rad_), c * std::cos(azimuth_rad_)};
}

tessera::Camera OrbitCamera::camera() const {
  tessera::Camera camera;
  camera.eye = target_ + distance_ * Back();
  camera.target = target_;
  camera.fov_y_rad = fov_y_rad_;
  return camera;
}

void LightAngles::Drag(double right_px, double down_px, int height_px) {
  const double rad_per_px = kPi / std::max(height_px, 1);
  Set(azimuth_rad - right_px * rad_per_px, elevation_rad - down_px * rad_per_px);
}

void LightAngles::Set(double new_azimuth_rad, double new_elevation_rad) {
  azimuth_rad = std::fmod(new_azimuth_rad, 2.0 * kPi);
  if (azimuth_rad < 0.0) {
    azimuth_rad += 2.0 * kPi;
  }
  elevation_rad = std::clamp(new_elevation_rad, -0.5 * kPi, 0.5 * kPi);
}

tessera::Light LightAngles::light() const {
  tessera::Light light;
  const double c = std::cos(elevation_rad);
  light.place = {c * std::cos(azimuth_rad), c * std::sin(azimuth_rad), std::sin(elevation_rad)};
  light.irradiance = Eigen::Vector3d::Constant(kPi * strength);
  return light;
}

}  // namespace tessera::viewer
