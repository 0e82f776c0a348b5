#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "btf/render/preview.h"
#include "btf/wang/shapes.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;
using testing::RandomDressing;
using testing::RandomTileSet;
using testing::SkewedGrid;
using testing::WhiteDiffuser;

constexpr int kFacingWidth = 160;
constexpr int kFacingHeight = 120;

// The largest share of half the frame, across or upwards, at which a vertex stands; infinite behind the eye.
double LargestExtent(const QuadMesh& mesh, const Camera& camera, double width_by_height) {
  const Eigen::Vector3d back = (camera.eye - camera.target).normalized();
  const Eigen::Vector3d right = camera.up.cross(back).normalized();
  const Eigen::Vector3d up = back.cross(right);
  const double tan_y = std::tan(0.5 * camera.fov_y_rad);
  double largest = 0.0;
  for (const Eigen::Vector3f& position : mesh.positions) {
    const Eigen::Vector3d d = position.cast<double>() - camera.eye;
    const double depth = -d.dot(back);
    if (depth <= 0.0) {
      return INFINITY;
    }
    largest = std::max({largest, std::abs(d.dot(up)) / (depth * tan_y),
                        std::abs(d.dot(right)) / (depth * width_by_height * tan_y)});
  }
  return largest;
}

TEST(FramingCamera, ShowsEveryVertexInsideTheFrame) {
  for (const std::string_view name : BuiltinShapeNames()) {
    const auto mesh = BuiltinShape(name);
    ASSERT_TRUE(mesh.ok());
    const double largest = LargestExtent(*mesh, FramingCamera(*mesh, 200, 100), 2.0);
    EXPECT_LE(largest, 1.0) << name;
    EXPECT_GT(largest, 0.8) << name;
  }
}

TEST(OrbitCamera, FramesTheMeshFromEverySideAtOneDistance) {
  for (const std::string_view name : BuiltinShapeNames()) {
    const auto mesh = BuiltinShape(name);
    ASSERT_TRUE(mesh.ok());
    for (const double elevation_deg : {-90.0, -30.0, 0.0, 25.0, 90.0}) {
      double largest = 0.0;
      double distance = 0.0;
      for (double azimuth_deg = -180.0; azimuth_deg < 180.0; azimuth_deg += 17.0) {
        const auto camera = OrbitCamera(*mesh,
                                        {.azimuth_rad = RadFromDeg(azimuth_deg),
                                         .elevation_rad = RadFromDeg(elevation_deg),
                                         .fov_y_rad = 0.8},
                                        200, 100);
        ASSERT_TRUE(camera.ok()) << camera.status();
        largest = std::max(largest, LargestExtent(*mesh, *camera, 2.0));
        const double here = (camera->eye - camera->target).norm();
        distance = distance == 0.0 ? here : distance;
        EXPECT_NEAR(here, distance, 1e-9 * distance);
        // No jump at the poles.
        EXPECT_NEAR(camera->up.dot(camera->eye - camera->target), 0.0, 1e-9);
      }
      EXPECT_LE(largest, 1.0) << name << " " << elevation_deg;
      EXPECT_GT(largest, 0.8) << name << " " << elevation_deg;
    }
  }
}

TEST(OrbitCamera, CountsAzimuthFromTheFrontTowardsX) {
  const auto mesh = BuiltinShape("cube-sphere");
  ASSERT_TRUE(mesh.ok());
  const auto back = [&](double azimuth_deg, double elevation_deg) -> Eigen::Vector3d {
    const auto camera = OrbitCamera(
        *mesh, {.azimuth_rad = RadFromDeg(azimuth_deg), .elevation_rad = RadFromDeg(elevation_deg)}, 64, 64);
    return (camera->eye - camera->target).normalized();
  };
  EXPECT_TRUE(back(0, 0).isApprox(Eigen::Vector3d::UnitZ(), 1e-9));
  EXPECT_TRUE(back(90, 0).isApprox(Eigen::Vector3d::UnitX(), 1e-9));
  EXPECT_TRUE(back(40, 90).isApprox(Eigen::Vector3d::UnitY(), 1e-9));
  const auto near = OrbitCamera(*mesh, {}, 64, 64);
  const auto far = OrbitCamera(*mesh, {.distance = 3.0}, 64, 64);
  EXPECT_NEAR((far->eye - far->target).norm(), 3.0 * (near->eye - near->target).norm(), 1e-9);
}

TEST(OrbitCamera, RefusesByName) {
  const auto mesh = BuiltinShape("plane");
  ASSERT_TRUE(mesh.ok());
  const auto message = [&](const Orbit& orbit) {
    const absl::Status status = OrbitCamera(*mesh, orbit, 64, 64).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  EXPECT_THAT(message({.azimuth_rad = NAN}), HasSubstr("azimuth"));
  EXPECT_THAT(message({.elevation_rad = 2.0}), HasSubstr("elevation in degrees: 114.5"));
  EXPECT_THAT(message({.distance = 0.0}), HasSubstr("distance: 0"));
  EXPECT_THAT(message({.fov_y_rad = NAN}), HasSubstr("field of view"));
  EXPECT_FALSE(OrbitCamera(QuadMesh(), {}, 64, 64).ok());
}

TEST(LightTurnedAbout, StaysWhereItIsForAnEyeThatTurnsWithIt) {
  const auto mesh = BuiltinShape("genus3");
  ASSERT_TRUE(mesh.ok());
  for (const Light::Kind kind : {Light::Kind::kDirectional, Light::Kind::kPoint}) {
    const Light light{.kind = kind, .place = {0.3, 0.8, 1.1}};
    const auto seen = [&](double azimuth_rad) -> Eigen::Vector3d {
      const auto camera = OrbitCamera(*mesh, {.azimuth_rad = azimuth_rad}, 64, 64);
      const Light turned = LightTurnedAbout(light, camera->target, azimuth_rad);
      const Eigen::Vector3d place =
          kind == Light::Kind::kPoint ? Eigen::Vector3d(turned.place - camera->target) : turned.place;
      const Eigen::Vector3d back = (camera->eye - camera->target).normalized();
      return {place.dot(camera->up.cross(back)), place.dot(camera->up), place.dot(back)};
    };
    EXPECT_TRUE(seen(1.3).isApprox(seen(0.0), 1e-9));
  }
}

TEST(PixelsPerQuad, IsTheLongestAxisOfTheWidestFaceThatFacesTheEye) {
  // Two units wide, of 4 x 4 faces.
  const Dressing dressing = RandomDressing(SkewedGrid(4, 0.0, 1), 2);
  PreviewScene scene{.dressing = &dressing, .width = kFacingWidth, .height = kFacingHeight};
  const double units_per_pixel = 2.0 * 3.0 * std::tan(0.5 * scene.camera.fov_y_rad) / kFacingHeight;
  scene.camera.eye = {0.0, 0.0, 3.0};
  EXPECT_NEAR(PixelsPerQuad(scene) * units_per_pixel, 0.5, 1e-5);
  // From aside faces are foreshortened along one axis alone, and those nearer the eye are wider.
  scene.camera.eye = {3.0 * std::sin(kPi / 3.0), 0.0, 1.5};
  EXPECT_GT(PixelsPerQuad(scene) * units_per_pixel, 0.5);
  EXPECT_LT(PixelsPerQuad(scene) * units_per_pixel, 0.75);
  scene.camera.eye = {0.0, 0.0, -3.0};
  EXPECT_EQ(PixelsPerQuad(scene), 0.0);
}

TEST(TexelsPerPixel, IsTheTexelsAlongAPixelOfAFacingPlane) {
  // Two units wide, of 4 x 4 tiles of 16 texels.
  const Dressing dressing = RandomDressing(SkewedGrid(4, 0.0, 1), 2);
  const TileSet tile_set = RandomTileSet(WhiteDiffuser(), 16, 3);
  PreviewScene scene{
      .dressing = &dressing, .tile_set = &tile_set, .width = kFacingWidth, .height = kFacingHeight};
  for (const double distance : {1.0, 3.0, 40.0}) {
    scene.camera.eye = {0.0, 0.0, distance};
    const double units_per_pixel = 2.0 * distance * std::tan(0.5 * scene.camera.fov_y_rad) / kFacingHeight;
    EXPECT_NEAR(TexelsPerPixel(scene) / (32.0 * units_per_pixel), 1.0, 1e-5);
    scene.camera.eye.z() = -distance;
    EXPECT_EQ(TexelsPerPixel(scene), 0.0);
  }
}

}  // namespace
}  // namespace tessera
