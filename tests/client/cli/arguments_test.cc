#include "client/cli/arguments.h"

#include <gtest/gtest.h>

#include "client/cli/exit_codes.h"

namespace tessera::cli {
namespace {

TEST(ArgumentsTest, PictureSizes) {
  const auto size = ParsePictureSize("640x480");
  ASSERT_TRUE(size.ok());
  EXPECT_EQ(size->width, 640u);
  EXPECT_EQ(size->height, 480u);
  for (const char* bad :
       {"", "640", "640x", "x480", "640x480x3", "15x480", "640x8193", "-640x480", "6e2x480"}) {
    EXPECT_EQ(ExitCodeOf(ParsePictureSize(bad).status()), kExitUsage) << bad;
  }
}

TEST(ArgumentsTest, DirectionsAreDegrees) {
  const auto direction = ParseDirection("45,-90");
  ASSERT_TRUE(direction.ok());
  EXPECT_NEAR(direction->theta_rad, kPi / 4, 1e-12);
  EXPECT_NEAR(direction->phi_rad, -kPi / 2, 1e-12);
  for (const char* bad : {"", "45", "45,", "91,0", "-1,0", "nan,0", "45,0,0", "45;0"}) {
    EXPECT_EQ(ExitCodeOf(ParseDirection(bad).status()), kExitUsage) << bad;
  }
}

TEST(ArgumentsTest, LightsFromADirection) {
  const auto light = ParseLight("90,90,2");
  ASSERT_TRUE(light.ok()) << light.status();
  EXPECT_EQ(light->kind(), v1::Light::DIRECTIONAL);
  EXPECT_NEAR(light->x(), 0, 1e-12);
  EXPECT_NEAR(light->y(), 1, 1e-12);
  EXPECT_NEAR(light->z(), 0, 1e-12);
  EXPECT_NEAR(light->green(), 2 * kPi, 1e-12);
  const auto overhead = ParseLight("0,0");
  ASSERT_TRUE(overhead.ok());
  EXPECT_NEAR(overhead->z(), 1, 1e-12);
  EXPECT_NEAR(overhead->red(), kPi, 1e-12);
}

TEST(ArgumentsTest, LightsAtAPoint) {
  const auto light = ParseLight("point:1,-2,3.5,0.5");
  ASSERT_TRUE(light.ok()) << light.status();
  EXPECT_EQ(light->kind(), v1::Light::POINT);
  EXPECT_EQ(light->y(), -2);
  EXPECT_EQ(light->z(), 3.5);
  EXPECT_NEAR(light->blue(), kPi / 2, 1e-12);
  for (const char* bad :
       {"point:", "point:1,2", "point:1,2,3,4,5", "point:1,2,3,0", "1,2,-1", "1,2,3,4", "inf,0"}) {
    EXPECT_EQ(ExitCodeOf(ParseLight(bad).status()), kExitUsage) << bad;
  }
}

TEST(ArgumentsTest, LightsHaveColours) {
  const auto light = ParseLight("0,0,1,0.5,0");
  ASSERT_TRUE(light.ok()) << light.status();
  EXPECT_NEAR(light->red(), kPi, 1e-12);
  EXPECT_NEAR(light->green(), kPi / 2, 1e-12);
  EXPECT_EQ(light->blue(), 0);
  for (const char* bad : {"0,0,0,0,0", "0,0,1,-1,1", "point:0,0,0,1,1", "0,0,1,1,1,1"}) {
    EXPECT_EQ(ExitCodeOf(ParseLight(bad).status()), kExitUsage) << bad;
  }
}

TEST(ArgumentsTest, PlacesAndOrbits) {
  EXPECT_EQ(ParsePlace("eye", "1,-2,3.5").value(), (std::array<double, 3>{1, -2, 3.5}));
  EXPECT_EQ(ExitCodeOf(ParsePlace("eye", "1,2").status()), kExitUsage);
  const auto orbit = ParseOrbit("30,-20,1.5");
  ASSERT_TRUE(orbit.ok()) << orbit.status();
  EXPECT_EQ(orbit->azimuth_deg(), 30);
  EXPECT_EQ(orbit->elevation_deg(), -20);
  EXPECT_EQ(orbit->distance(), 1.5);
  EXPECT_EQ(ParseOrbit("30,-20")->distance(), 1.0);
  for (const char* bad : {"30", "30,20,0", "30,20,-1", "a,20", "1,2,3,4"}) {
    EXPECT_EQ(ExitCodeOf(ParseOrbit(bad).status()), kExitUsage) << bad;
  }
}

TEST(ArgumentsTest, FormatsAndBuiltins) {
  EXPECT_EQ(PictureFormatOf("a/b.png").value(), PictureFormat::kPng);
  EXPECT_EQ(PictureFormatOf("b.exr").value(), PictureFormat::kExr);
  EXPECT_EQ(ExitCodeOf(PictureFormatOf("b.jpg").status()), kExitUsage);
  EXPECT_EQ(BuiltinName("builtin:torus"), "torus");
  EXPECT_FALSE(BuiltinName("torus.obj").has_value());
}

}  // namespace
}  // namespace tessera::cli
