#include <algorithm>
#include <array>
#include <cmath>

#include "btf/render/preview.h"
#include "btf/render/preview_scene.h"

namespace tessera {

Camera FramingCamera(const QuadMesh& mesh, int width, int height) {
  Camera camera;
  if (mesh.positions.empty() || width <= 0 || height <= 0) {
    return camera;
  }
  Eigen::Vector3d low = mesh.positions[0].cast<double>();
  Eigen::Vector3d high = low;
  for (const Eigen::Vector3f& position : mesh.positions) {
    low = low.cwiseMin(position.cast<double>());
    high = high.cwiseMax(position.cast<double>());
  }
  const Eigen::Vector3d extent = high - low;
  camera.target = 0.5 * (low + high);
  // Flat meshes are looked at along their normal; solids from a little above.
  const double largest = std::max(extent.maxCoeff(), 1e-9);
  const bool flat = extent.z() < 1e-3 * largest;
  const double elevation_rad = RadFromDeg(flat ? 0.0 : 25.0);
  const Eigen::Vector3d back(0.0, std::sin(elevation_rad), std::cos(elevation_rad));
  const Eigen::Vector3d up(0.0, std::cos(elevation_rad), -std::sin(elevation_rad));
  const double tan_y = std::tan(0.5 * camera.fov_y_rad);
  const double tan_x = tan_y * width / height;
  // The nearest eye on the ray `back` that keeps every vertex inside the frame, with a margin around it.
  constexpr double kMargin = 1.08;
  double distance = 0.0;
  for (const Eigen::Vector3f& position : mesh.positions) {
    const Eigen::Vector3d p = position.cast<double>() - camera.target;
    const double towards_eye = p.dot(back);
    distance = std::max({distance, towards_eye + kMargin * std::abs(p.x()) / tan_x,
                         towards_eye + kMargin * std::abs(p.dot(up)) / tan_y, towards_eye + 0.05 * largest});
  }
  camera.eye = camera.target + distance * back;
  camera.up = {0.0, 1.0, 0.0};
  return camera;
}

double TexelsPerPixel(const PreviewScene& scene) {
  const QuadMesh& mesh = scene.dressing->mesh;
  if (mesh.quads.empty()) {
    return 0.0;
  }
  const ViewFrame view = MakeViewFrame(scene.camera, TriangulateSurface(mesh));
  const double focal_pixels = 0.5 * scene.height / view.tan_half_fov_y;
  double pixels = 0.0;
  double faces = 0.0;
  for (const Quad& quad : mesh.quads) {
    std::array<Eigen::Vector2d, 4> p;
    bool is_before_eye = true;
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d from_eye = mesh.positions[quad[k]].cast<double>() - view.eye;
      const double depth = -from_eye.dot(view.back);
      is_before_eye = is_before_eye && depth > view.near;
      p[k] = focal_pixels / depth * Eigen::Vector2d(from_eye.dot(view.right), from_eye.dot(view.up));
    }
    const Eigen::Vector2d a = p[2] - p[0];
    const Eigen::Vector2d b = p[3] - p[1];
    const double area = 0.5 * (a.x() * b.y() - a.y() * b.x());
    if (is_before_eye && area > 0.0) {
      pixels += area;
      faces += 1.0;
    }
  }
  return pixels > 0.0 ? scene.tile_set->tile_size * std::sqrt(faces / pixels) : 0.0;
}

}  // namespace tessera
