#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include <absl/strings/str_cat.h>
#include <Eigen/Geometry>

#include "btf/base/status_macros.h"
#include "btf/light/q2_tree.h"
#include "btf/render/preview.h"
#include "btf/render/preview_scene.h"

namespace tessera {
namespace {

// Room around a framed mesh.
constexpr double kMargin = 1.08;
constexpr int kOrbitSteps = 72;

struct Bounds {
  Eigen::Vector3d centre;
  Eigen::Vector3d extent;
  double largest = 0.0;  // of the extent, not 0
};

Bounds BoundsOf(const QuadMesh& mesh) {
  Eigen::Vector3d low = mesh.positions[0].cast<double>();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3f& position : mesh.positions) {
    low = low.cwiseMin(position.cast<double>());
    high = high.cwiseMax(position.cast<double>());
  }
  const Eigen::Vector3d extent = high - low;
  return {.centre = 0.5 * (low + high), .extent = extent, .largest = std::max(extent.maxCoeff(), 1e-9)};
}

// Axes of an eye at an azimuth about the y axis, from +z towards +x, and an elevation above the horizon.
struct Axes {
  Axes(double azimuth_rad, double elevation_rad)
      : right(std::cos(azimuth_rad), 0.0, -std::sin(azimuth_rad)),
        back(std::sin(azimuth_rad) * std::cos(elevation_rad), std::sin(elevation_rad),
             std::cos(azimuth_rad) * std::cos(elevation_rad)),
        up(back.cross(right)) {}

  Eigen::Vector3d right;
  Eigen::Vector3d back;
  Eigen::Vector3d up;
};

// The least distance of the eye from the centre at which every vertex lies inside the frame.
double FramingDistance(const QuadMesh& mesh, const Bounds& bounds, const Axes& axes, double tan_x,
                       double tan_y) {
  double distance = 0.0;
  for (const Eigen::Vector3f& position : mesh.positions) {
    const Eigen::Vector3d p = position.cast<double>() - bounds.centre;
    const double towards_eye = p.dot(axes.back);
    distance = std::max({distance, towards_eye + kMargin * std::abs(p.dot(axes.right)) / tan_x,
                         towards_eye + kMargin * std::abs(p.dot(axes.up)) / tan_y,
                         towards_eye + 0.05 * bounds.largest});
  }
  return distance;
}

absl::Status CheckRange(const char* name, double value, double least, double most) {
  if (!(value >= least && value <= most)) {
    return absl::InvalidArgumentError(
        absl::StrCat("orbit ", name, ": ", value, ", expected ", least, " to ", most));
  }
  return absl::OkStatus();
}

// The corners of a face, in pixels.
using FaceInPicture = std::array<Eigen::Vector2d, 4>;

// Of the faces before the eye that look at it.
void ForFacesInPicture(const PreviewScene& scene, const std::function<void(const FaceInPicture&)>& body) {
  const QuadMesh& mesh = scene.dressing->mesh;
  if (mesh.quads.empty()) {
    return;
  }
  const ViewFrame view = MakeViewFrame(scene.camera, TriangulateSurface(mesh));
  const double focal_pixels = 0.5 * scene.height / view.tan_half_fov_y;
  for (const Quad& quad : mesh.quads) {
    FaceInPicture p;
    bool is_before_eye = true;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d from_eye = mesh.positions[quad[k]].cast<double>() - view.eye;
      const double depth = -from_eye.dot(view.back);
      is_before_eye = is_before_eye && depth > view.near;
      p[k] = focal_pixels / depth * Eigen::Vector2d(from_eye.dot(view.right), from_eye.dot(view.up));
    }
    const Eigen::Vector2d a = p[2] - p[0];
    const Eigen::Vector2d b = p[3] - p[1];
    if (is_before_eye && a.x() * b.y() - a.y() * b.x() > 0.0) {
      body(p);
    }
  }
}

}  // namespace

Camera FramingCamera(const QuadMesh& mesh, int width, int height) {
  Camera camera;
  if (mesh.positions.empty() || width <= 0 || height <= 0) {
    return camera;
  }
  const Bounds bounds = BoundsOf(mesh);
  // Flat meshes are looked at along their normal; solids from a little above.
  const bool flat = bounds.extent.z() < 1e-3 * bounds.largest;
  const Axes axes(0.0, RadFromDeg(flat ? 0.0 : 25.0));
  const double tan_y = std::tan(0.5 * camera.fov_y_rad);
  camera.target = bounds.centre;
  camera.eye = camera.target + FramingDistance(mesh, bounds, axes, tan_y * width / height, tan_y) * axes.back;
  camera.up = {0.0, 1.0, 0.0};
  return camera;
}

absl::StatusOr<Camera> OrbitCamera(const QuadMesh& mesh, const Orbit& orbit, int width, int height) {
  if (mesh.positions.empty() || width <= 0 || height <= 0) {
    return absl::InvalidArgumentError("an orbit needs a mesh with vertices and a picture with pixels");
  }
  if (!std::isfinite(orbit.azimuth_rad)) {
    return absl::InvalidArgumentError("orbit azimuth: not a number");
  }
  TESSERA_RETURN_IF_ERROR(CheckRange("elevation in degrees", DegFromRad(orbit.elevation_rad), -90.0, 90.0));
  TESSERA_RETURN_IF_ERROR(CheckRange("distance", orbit.distance, kLeastOrbitDistance, kMostOrbitDistance));
  TESSERA_RETURN_IF_ERROR(CheckRange("field of view in degrees", DegFromRad(orbit.fov_y_rad),
                                     kLeastFieldOfViewDeg, kMostFieldOfViewDeg));
  const Bounds bounds = BoundsOf(mesh);
  const double tan_y = std::tan(0.5 * orbit.fov_y_rad);
  double distance = 0.0;
  for (int step = 0; step < kOrbitSteps; ++step) {
    const Axes axes(2.0 * kPi * step / kOrbitSteps, orbit.elevation_rad);
    distance = std::max(distance, FramingDistance(mesh, bounds, axes, tan_y * width / height, tan_y));
  }
  const Axes axes(orbit.azimuth_rad, orbit.elevation_rad);
  Camera camera{.target = bounds.centre, .up = axes.up, .fov_y_rad = orbit.fov_y_rad};
  camera.eye = camera.target + orbit.distance * distance * axes.back;
  return camera;
}

Light LightTurnedAbout(const Light& light, const Eigen::Vector3d& centre, double azimuth_rad) {
  const Eigen::AngleAxisd turn(azimuth_rad, Eigen::Vector3d::UnitY());
  Light turned = light;
  turned.place = light.kind == Light::Kind::kPoint ? Eigen::Vector3d(centre + turn * (light.place - centre))
                                                   : Eigen::Vector3d(turn * light.place);
  return turned;
}

std::vector<Light> DirectionalLights(std::span<const EnvironmentLight> lights) {
  std::vector<Light> directional;
  for (const EnvironmentLight& light : lights) {
    directional.push_back({.place = light.direction, .irradiance = light.irradiance.matrix()});
  }
  return directional;
}

double TexelsPerPixel(const PreviewScene& scene) {
  double pixels = 0.0;
  double faces = 0.0;
  ForFacesInPicture(scene, [&](const FaceInPicture& p) {
    const Eigen::Vector2d a = p[2] - p[0];
    const Eigen::Vector2d b = p[3] - p[1];
    pixels += 0.5 * (a.x() * b.y() - a.y() * b.x());
    faces += 1.0;
  });
  return pixels > 0.0 ? scene.tile_set->tile_size * std::sqrt(faces / pixels) : 0.0;
}

double PixelsPerQuad(const PreviewScene& scene) {
  double most = 0.0;
  ForFacesInPicture(scene, [&most](const FaceInPicture& p) {
    // The larger singular value of [s t], as half a sum of two lengths.
    const Eigen::Vector2d s = 0.5 * (p[1] - p[0] + p[2] - p[3]);
    const Eigen::Vector2d t = 0.5 * (p[3] - p[0] + p[2] - p[1]);
    const double sum = Eigen::Vector2d(s.x() + t.y(), s.y() - t.x()).norm();
    const double difference = Eigen::Vector2d(s.x() - t.y(), s.y() + t.x()).norm();
    most = std::max(most, 0.5 * (sum + difference));
  });
  return most;
}

}  // namespace tessera
