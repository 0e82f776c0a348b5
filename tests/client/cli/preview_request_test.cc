#include "client/cli/preview_request.h"

#include <gtest/gtest.h>

#include "client/cli/exit_codes.h"

namespace tessera::cli {
namespace {

PreviewFlags Plain() {
  return {.tile_sets = {"surface-96/wool"}, .meshes = {"builtin:torus"}, .output = "a.png"};
}

int CodeOf(const PreviewFlags& flags) {
  return ExitCodeOf(CheckPreviewFlags(flags));
}

TEST(PreviewRequestTest, PlainFlagsAskForThePlainPicture) {
  EXPECT_TRUE(CheckPreviewFlags(Plain()).ok());
  const auto request = PreviewRequest(Plain());
  ASSERT_TRUE(request.ok()) << request.status();
  EXPECT_FALSE(request->has_camera() || request->has_orbit() || request->has_tone() || request->shadows());
  EXPECT_EQ(request->background(), "");
  EXPECT_EQ(request->lights_size(), 0);
}

TEST(PreviewRequestTest, FlagsThatDoNotGoTogetherAreRefused) {
  const auto with = [](auto&& change) {
    PreviewFlags flags = Plain();
    change(flags);
    return CodeOf(flags);
  };
  EXPECT_EQ(with([](PreviewFlags& f) { f.meshes.clear(); }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.target = "0,0,0"; }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.eye = "0,0,3", f.orbit = "0,0"; }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.fov_deg = 20; }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.shadow_map = 256; }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.animated = true; }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.columns = 2; }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.output = "a.apng"; }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.turntable = 4, f.sheet = true; }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.turntable = 4, f.meshes.push_back("builtin:plane"); }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.sheet = true, f.output = "a.exr"; }), kExitUsage);
  EXPECT_EQ(with([](PreviewFlags& f) { f.turntable = 4, f.animated = true, f.output = "a.apng"; }), kExitOk);
  EXPECT_EQ(with([](PreviewFlags& f) { f.meshes.push_back("a.obj"), f.sheet = true; }), kExitOk);
}

TEST(PreviewRequestTest, TurntablesTurnEyeAndLightsOnceRound) {
  PreviewFlags flags = Plain();
  flags.turntable = 8;
  const v1::RenderPreviewRequest base = PreviewRequest(flags).value();
  EXPECT_EQ(base.orbit().elevation_deg(), 25);
  EXPECT_EQ(TurntableRequest(base, 0, 8).orbit().azimuth_deg(), 0);
  EXPECT_EQ(TurntableRequest(base, 2, 8).orbit().azimuth_deg(), 90);
  EXPECT_TRUE(TurntableRequest(base, 2, 8).orbit().turns_lights());
  flags.orbit = "10,-5,2";
  flags.fov_deg = 20;
  const v1::RenderPreviewRequest turned = TurntableRequest(PreviewRequest(flags).value(), 4, 8);
  EXPECT_EQ(turned.orbit().azimuth_deg(), 190);
  EXPECT_EQ(turned.orbit().fov_y_deg(), 20);
}

TEST(PreviewRequestTest, SettingsReachTheRequest) {
  PreviewFlags flags = Plain();
  flags.eye = "1,2,3";
  flags.up = "0,0,1";
  flags.shadows = true;
  flags.shadow_map = 512;
  flags.exposure_stops = -1.5;
  flags.tone = "filmic";
  flags.background = "ffffff";
  const v1::RenderPreviewRequest request = PreviewRequest(flags).value();
  EXPECT_EQ(request.camera().eye_z(), 3);
  EXPECT_EQ(request.camera().up_z(), 1);
  EXPECT_EQ(request.shadow_map_size(), 512u);
  EXPECT_EQ(request.tone().curve(), v1::Tone::FILMIC);
  EXPECT_EQ(request.tone().exposure_stops(), -1.5);
  EXPECT_EQ(request.background(), "ffffff");
}

}  // namespace
}  // namespace tessera::cli
