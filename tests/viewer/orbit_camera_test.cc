#include "viewer/orbit_camera.h"

#include <gtest/gtest.h>

#include "btf/wang/shapes.h"

namespace tessera::viewer {
namespace {

constexpr double kRounding = 1e-9;

tessera::Camera TorusCamera() {
  return FramingCamera(*BuiltinShape("torus"), 640, 480);
}

TEST(OrbitCameraTest, BeginsWhereTheMeshIsFramed) {
  const tessera::Camera framing = TorusCamera();
  const tessera::Camera camera = OrbitCamera(framing).camera();
  EXPECT_LT((camera.eye - framing.eye).norm(), kRounding);
  EXPECT_LT((camera.target - framing.target).norm(), kRounding);
}

TEST(OrbitCameraTest, OrbitingKeepsTheDistanceAndTurnsBackAgain) {
  const tessera::Camera framing = TorusCamera();
  OrbitCamera orbit(framing);
  orbit.Orbit(120.0, -30.0, 480);
  const tessera::Camera moved = orbit.camera();
  EXPECT_NEAR((moved.eye - moved.target).norm(), (framing.eye - framing.target).norm(), kRounding);
  // What is dragged to the right goes right: the eye goes left.
  EXPECT_LT(moved.eye.x(), framing.eye.x());
  orbit.Orbit(-120.0, 30.0, 480);
  EXPECT_LT((orbit.camera().eye - framing.eye).norm(), kRounding);
}

TEST(OrbitCameraTest, NeverReachesThePoleOrTheTarget) {
  OrbitCamera orbit(TorusCamera());
  orbit.Orbit(0.0, 1e6, 480);
  orbit.Zoom(1e6);
  const tessera::Camera camera = orbit.camera();
  const Eigen::Vector3d back = camera.eye - camera.target;
  EXPECT_GT(back.norm(), 1e-3);
  EXPECT_LT(back.y() / back.norm(), 0.9999);
}

TEST(OrbitCameraTest, PanningMovesTheTargetAgainstTheMouse) {
  OrbitCamera orbit(TorusCamera());
  orbit.Pan(48.0, 0.0, 480);
  EXPECT_LT(orbit.camera().target.x(), 0.0);
  orbit.Pan(0.0, 48.0, 480);
  EXPECT_GT(orbit.camera().target.y(), 0.0);
}

TEST(LightAnglesTest, ShinesFromItsAngles) {
  LightAngles light;
  light.Set(0.0, 0.0);
  EXPECT_LT((light.light().place - Eigen::Vector3d::UnitX()).norm(), kRounding);
  light.Set(RadFromDeg(-90.0), RadFromDeg(30.0));
  EXPECT_NEAR(light.azimuth_rad, RadFromDeg(270.0), kRounding);
  EXPECT_NEAR(light.light().place.z(), 0.5, kRounding);
  light.Set(0.0, 100.0);
  EXPECT_LT((light.light().place - Eigen::Vector3d::UnitZ()).norm(), kRounding);
}

}  // namespace
}  // namespace tessera::viewer
