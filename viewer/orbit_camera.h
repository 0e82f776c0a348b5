// A camera that circles a point, and a light that does: what the mouse moves.
#pragma once

#include <Eigen/Core>

#include "btf/math/conventions.h"
#include "btf/render/preview.h"

namespace tessera::viewer {

// y is up. Elevation stays short of the poles, distance within factors of the one that frames the mesh.
class OrbitCamera {
 public:
  OrbitCamera() = default;
  // Starts where `framing` stands.
  explicit OrbitCamera(const tessera::Camera& framing);

  // By pixels that the mouse moved: half a turn takes a picture's height.
  void Orbit(double right_px, double down_px, int height_px);
  // The point under the mouse stays there, at the distance of the target.
  void Pan(double right_px, double down_px, int height_px);
  // Positive comes nearer, by 10 % a step.
  void Zoom(double steps);

  [[nodiscard]] tessera::Camera camera() const;

 private:
  [[nodiscard]] Eigen::Vector3d Back() const;  // from the target to the eye, unit

  Eigen::Vector3d target_{0, 0, 0};
  double azimuth_rad_ = 0.0;  // of the eye about y, from +z towards +x
  double elevation_rad_ = 0.0;
  double distance_ = 3.0;
  double framing_distance_ = 3.0;
  double fov_y_rad_ = RadFromDeg(35.0);
};

// A directional light: azimuth from +x towards +y, elevation from the xy plane towards +z (the viewer of an
// unturned scene). The command line's --light TH,PH has TH = 90 degrees - elevation, PH = azimuth.
struct LightAngles {
  double azimuth_rad = RadFromDeg(130.0);
  double elevation_rad = RadFromDeg(50.0);
  double strength = 1.0;  // times an irradiance of pi

  // Half a turn takes a picture's height.
  void Drag(double right_px, double down_px, int height_px);
  // Elevation within -90 to 90 degrees, azimuth within 0 to 360.
  void Set(double new_azimuth_rad, double new_elevation_rad);
  [[nodiscard]] tessera::Light light() const;
};

}  // namespace tessera::viewer
