#include "btf/render/preview_scene.h"

#include <algorithm>
#include <cmath>

#include <absl/strings/str_cat.h>
#include <Eigen/Geometry>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

absl::Status CheckSide(const char* name, int side) {
  if (side < kLeastPreviewSide || side > kMostPreviewSide) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": ", side, ", expected ", kLeastPreviewSide, "..", kMostPreviewSide));
  }
  return absl::OkStatus();
}

// Above this there is no room for a float's digits beside the square of a distance.
constexpr double kLargestCoordinate = 1e15;

absl::Status CheckVector(const std::string& name, const Eigen::Vector3d& v) {
  if (!v.allFinite() || v.cwiseAbs().maxCoeff() > kLargestCoordinate) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": (", v.x(), ", ", v.y(), ", ", v.z(),
                                                   "), expected finite values up to ", kLargestCoordinate));
  }
  return absl::OkStatus();
}

// More triangles than this are never made by cutting faces.
constexpr size_t kMostCells = size_t{1} << 19;

// The number of cells a side: the error of (s, q) in a face cut in two triangles falls with its square.
int CellsPerSide(const QuadMesh& mesh) {
  double worst = 0.0;
  for (const Quad& quad : mesh.quads) {
    std::array<Eigen::Vector3d, 4> p;
    for (int k = 0; k < 4; ++k) {
      p[k] = mesh.positions[quad[k]].cast<double>();
    }
    const double size = 0.5 * ((p[2] - p[0]).norm() + (p[3] - p[1]).norm());
    if (size > 0.0) {
      worst = std::max(worst, (p[0] - p[1] + p[2] - p[3]).norm() / size);
    }
  }
  constexpr double kSkewOfOneCell = 0.02;
  int cells = 1;
  while (cells < 8 && worst > kSkewOfOneCell * cells * cells &&
         mesh.quads.size() * 4 * cells * cells <= kMostCells) {
    cells *= 2;
  }
  return cells;
}

}  // namespace

absl::Status CheckScene(const PreviewScene& scene) {
  if (scene.dressing == nullptr || scene.tile_set == nullptr) {
    return absl::InvalidArgumentError("the scene has no dressing or no tile set");
  }
  if (scene.dressing->mesh.quads.empty()) {
    return absl::InvalidArgumentError("the dressing has no quads");
  }
  TESSERA_RETURN_IF_ERROR(CheckSide("width", scene.width));
  TESSERA_RETURN_IF_ERROR(CheckSide("height", scene.height));
  TESSERA_RETURN_IF_ERROR(CheckVector("camera eye", scene.camera.eye));
  TESSERA_RETURN_IF_ERROR(CheckVector("camera target", scene.camera.target));
  TESSERA_RETURN_IF_ERROR(CheckVector("camera up", scene.camera.up));
  if ((scene.camera.eye - scene.camera.target).norm() == 0.0) {
    return absl::InvalidArgumentError("camera eye and target are the same point");
  }
  if (scene.camera.up.norm() == 0.0) {
    return absl::InvalidArgumentError("camera up is zero");
  }
  const double fov = scene.camera.fov_y_rad;
  if (!(fov >= RadFromDeg(kLeastFieldOfViewDeg) && fov <= RadFromDeg(kMostFieldOfViewDeg))) {
    return absl::InvalidArgumentError(absl::StrCat("camera field of view: ", DegFromRad(fov),
                                                   " degrees, expected ", kLeastFieldOfViewDeg, "..",
                                                   kMostFieldOfViewDeg));
  }
  if (scene.lights.size() > kMostPreviewLights) {
    return absl::InvalidArgumentError(
        absl::StrCat(scene.lights.size(), " lights, expected at most ", kMostPreviewLights));
  }
  if (scene.shadows.has_value() &&
      (scene.shadows->map_size < kLeastShadowMap || scene.shadows->map_size > kMostShadowMap)) {
    return absl::InvalidArgumentError(absl::StrCat("shadow map size: ", scene.shadows->map_size,
                                                   ", expected ", kLeastShadowMap, "..", kMostShadowMap));
  }
  for (size_t i = 0; i < scene.lights.size(); ++i) {
    const Light& light = scene.lights[i];
    TESSERA_RETURN_IF_ERROR(CheckVector(absl::StrCat("light ", i, " place"), light.place));
    TESSERA_RETURN_IF_ERROR(CheckVector(absl::StrCat("light ", i, " irradiance"), light.irradiance));
    if (light.irradiance.minCoeff() < 0.0) {
      return absl::InvalidArgumentError(absl::StrCat("light ", i, " irradiance is negative"));
    }
    if (light.kind == Light::Kind::kDirectional && light.place.norm() == 0.0) {
      return absl::InvalidArgumentError(absl::StrCat("light ", i, " has no direction"));
    }
  }
  return absl::OkStatus();
}

SurfaceTriangles TriangulateSurface(const QuadMesh& mesh) {
  SurfaceTriangles result;
  Eigen::Vector3d low = mesh.positions[mesh.quads[0][0]].cast<double>();
  Eigen::Vector3d high = low;
  for (const Quad& quad : mesh.quads) {
    for (const uint32_t vertex : quad) {
      low = low.cwiseMin(mesh.positions[vertex].cast<double>());
      high = high.cwiseMax(mesh.positions[vertex].cast<double>());
    }
  }
  result.centre = 0.5 * (low + high);
  result.radius = 0.5 * (high - low).norm();
  result.cells = CellsPerSide(mesh);
  const int n = result.cells;
  result.vertices.reserve(mesh.quads.size() * (n + 1) * (n + 1));
  result.indices.reserve(mesh.quads.size() * n * n * 6);
  for (size_t f = 0; f < mesh.quads.size(); ++f) {
    std::array<Eigen::Vector3d, 4> p;
    for (int k = 0; k < 4; ++k) {
      p[k] = mesh.positions[mesh.quads[f][k]].cast<double>() - result.centre;
    }
    const auto first = static_cast<uint32_t>(result.vertices.size());
    for (int j = 0; j <= n; ++j) {
      const double q = static_cast<double>(j) / n;
      for (int i = 0; i <= n; ++i) {
        const double s = static_cast<double>(i) / n;
        const Eigen::Vector3d position =
            (1.0 - q) * ((1.0 - s) * p[0] + s * p[1]) + q * ((1.0 - s) * p[3] + s * p[2]);
        result.vertices.push_back({position.cast<float>(),
                                   {static_cast<float>(s), static_cast<float>(q)},
                                   static_cast<uint32_t>(f)});
      }
    }
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        const uint32_t v = first + j * (n + 1) + i;
        const uint32_t above = v + n + 1;
        result.indices.insert(result.indices.end(), {v, v + 1, above + 1, v, above + 1, above});
      }
    }
  }
  return result;
}

ViewFrame MakeViewFrame(const Camera& camera, const SurfaceTriangles& triangles) {
  ViewFrame view;
  view.eye = camera.eye;
  view.back = (camera.eye - camera.target).normalized();
  view.right = camera.up.cross(view.back);
  // Looking along `up`: any axis across will do.
  if (view.right.norm() < 1e-9 * camera.up.norm()) {
    view.right = std::abs(view.back.x()) < 0.6 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
    view.right -= view.right.dot(view.back) * view.back;
  }
  view.right.normalize();
  view.up = view.back.cross(view.right);
  view.tan_half_fov_y = std::tan(0.5 * camera.fov_y_rad);
  const double depth = (camera.eye - triangles.centre).dot(view.back);
  const double radius = std::max(triangles.radius, 1e-9);
  view.far = std::max(depth + 1.01 * radius, 1e-3 * radius);
  // Inside or beside the surface the near plane stays at a thousandth of its size.
  view.near = std::max(depth - 1.01 * radius, 1e-3 * radius);
  view.far = std::max(view.far, 2.0 * view.near);
  return view;
}

}  // namespace tessera
