#include "proto/wire/convert.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr double kRoundingDeg = 1e-12;  // one conversion to degrees and back

TEST(ConvertTest, DirectionsAreDegreesOnTheWire) {
  const v1::Direction message = MessageFromDirection({kPi / 4, kPi});
  EXPECT_NEAR(message.polar_deg(), 45, kRoundingDeg);
  EXPECT_NEAR(message.azimuth_deg(), 180, kRoundingDeg);
  EXPECT_NEAR(DirectionFromMessage(message).theta_rad, kPi / 4, kRoundingDeg);
}

TEST(ConvertTest, ArrangementsComeBackAndAreChecked) {
  for (const Arrangement& arrangement : BuiltinArrangements()) {
    v1::Arrangement message = MessageFromArrangement(arrangement);
    const auto back = ArrangementFromMessage(message);
    ASSERT_TRUE(back.ok()) << back.status();
    EXPECT_EQ(back->id, arrangement.id);
    EXPECT_EQ(back->codes, arrangement.codes);
    EXPECT_EQ(back->num_colours, arrangement.num_colours);
    EXPECT_EQ(back->turned_strips, arrangement.turned_strips);
    EXPECT_EQ(back->sha256, arrangement.sha256);
    message.set_tile_codes(0, message.tile_codes(0) + 1);
    EXPECT_EQ(ArrangementFromMessage(message).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(ConvertTest, ArrangementsHaveTwoColoursUnlessTheySay) {
  v1::Arrangement message = MessageFromArrangement(**FindArrangement("surface-96"));
  message.clear_num_colours();
  EXPECT_EQ(ArrangementFromMessage(message)->num_colours, 2);
  message = MessageFromArrangement(**FindArrangement("plane-81"));
  message.clear_num_colours();
  EXPECT_THAT(std::string(ArrangementFromMessage(message).status().message()),
              testing::HasSubstr("tile code 756 does not exist with 2 colours"));
  message.set_num_colours(1u << 31);
  EXPECT_THAT(std::string(ArrangementFromMessage(message).status().message()),
              testing::HasSubstr("2147483648 colours, expected at most 127"));
}

TEST(ConvertTest, EncodeOptionsHaveDefaults) {
  const auto request = ModelRequestFromMessage({});
  ASSERT_TRUE(request.ok());
  EXPECT_EQ(request->codec, "dsh-cls");
  EXPECT_EQ(request->params.kl, 25);
  EXPECT_EQ(request->params.kv, 25);
  EXPECT_EQ(request->params.cls_energy, ClsEnergy::kHemisphere);
  EXPECT_EQ(request->params.rank, 0);
  EXPECT_FALSE(request->scene_light.has_value());
  v1::EncodeOptions message;
  message.set_cls_energy("cube");
  EXPECT_EQ(ModelRequestFromMessage(message).status().code(), absl::StatusCode::kInvalidArgument);
  message.set_cls_energy("sphere");
  message.set_kl(16);
  EXPECT_EQ(ModelRequestFromMessage(message)->params.kl, 16);
  EXPECT_EQ(ModelRequestFromMessage(message)->params.cls_energy, ClsEnergy::kSphere);
  EXPECT_EQ(ModelRequestFromMessage(message)->params.eigen_textures, 5);
  message.set_eigen_textures(12);
  EXPECT_EQ(ModelRequestFromMessage(message)->params.eigen_textures, 12);
  message.set_eigen_textures(1u << 31);
  EXPECT_EQ(ModelRequestFromMessage(message).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ConvertTest, BoundsOfAModelComeThrough) {
  v1::EncodeOptions message;
  message.set_codec("dfmf");
  EXPECT_EQ(ModelRequestFromMessage(message)->params.rank, kDefaultDfmfRank);
  message.set_rank(24);
  EXPECT_EQ(ModelRequestFromMessage(message)->params.rank, 24);
  message.set_rank(1u << 31);
  EXPECT_EQ(ModelRequestFromMessage(message).status().code(), absl::StatusCode::kInvalidArgument);

  message.Clear();
  message.set_codec("dfmf");
  message.set_max_error(0.02);
  EXPECT_EQ(ModelRequestFromMessage(message)->params.rank, 0);
  EXPECT_EQ(ModelRequestFromMessage(message)->params.max_error, 0.02);

  message.Clear();
  message.set_codec("auto");
  message.set_max_bytes(uint64_t{5} << 32);
  EXPECT_EQ(ModelRequestFromMessage(message)->codec, kAutoCodec);
  EXPECT_EQ(ModelRequestFromMessage(message)->params.max_bytes, uint64_t{5} << 32);
  EXPECT_EQ(ModelRequestFromMessage(message)->scene_light, SceneLight::kPoint);
  message.set_scene_light("environment");
  EXPECT_EQ(ModelRequestFromMessage(message)->scene_light, SceneLight::kEnvironment);
  message.set_scene_light("disco");
  const absl::Status refused = ModelRequestFromMessage(message).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(refused.message().find("disco"), absl::string_view::npos);
}

TEST(ConvertTest, EqualWorkIsEqualBytes) {
  v1::EncodeOptions said;
  said.set_codec("auto");
  said.set_max_error(0.05);
  v1::EncodeOptions implied = said;
  said.set_scene_light("point");
  FillDefaults(said);
  FillDefaults(implied);
  EXPECT_EQ(said.SerializeAsString(), implied.SerializeAsString());
  v1::EncodeOptions ranked;
  ranked.set_codec("dfmf");
  v1::EncodeOptions bare = ranked;
  ranked.set_rank(kDefaultDfmfRank);
  FillDefaults(ranked);
  FillDefaults(bare);
  EXPECT_EQ(ranked.SerializeAsString(), bare.SerializeAsString());
}

TEST(ConvertTest, LightsAndCamerasComeBack) {
  Light light{.kind = Light::Kind::kPoint, .place = {1, 2, 3}, .irradiance = {4, 5, 6}};
  const Light back = LightFromMessage(MessageFromLight(light));
  EXPECT_EQ(back.kind, light.kind);
  EXPECT_EQ(back.place, light.place);
  EXPECT_EQ(back.irradiance, light.irradiance);
  EXPECT_EQ(LightFromMessage({}).irradiance, Eigen::Vector3d::Constant(kPi));

  Camera camera{.eye = {1, 2, 3}, .target = {0, 1, 0}, .up = {0, 0, 2}};
  const Camera camera_back = CameraFromMessage(MessageFromCamera(camera));
  EXPECT_EQ(camera_back.eye, camera.eye);
  EXPECT_EQ(camera_back.target, camera.target);
  EXPECT_EQ(camera_back.up, camera.up);
  EXPECT_EQ(CameraFromMessage({}).up, Eigen::Vector3d::UnitY());
  EXPECT_NEAR(camera_back.fov_y_rad, camera.fov_y_rad, kRoundingDeg);
  EXPECT_NEAR(CameraFromMessage({}).fov_y_rad, RadFromDeg(35), kRoundingDeg);
}

TEST(ConvertTest, OrbitsAndTonesHaveDefaults) {
  const Orbit orbit = OrbitFromMessage({});
  EXPECT_EQ(orbit.azimuth_rad, 0);
  EXPECT_EQ(orbit.elevation_rad, 0);
  EXPECT_EQ(orbit.distance, 1);
  EXPECT_NEAR(orbit.fov_y_rad, RadFromDeg(35), kRoundingDeg);
  v1::Orbit message;
  message.set_azimuth_deg(90);
  message.set_distance(2);
  EXPECT_NEAR(OrbitFromMessage(message).azimuth_rad, RadFromDeg(90), kRoundingDeg);
  EXPECT_EQ(OrbitFromMessage(message).distance, 2);

  EXPECT_EQ(*ToneFromMessage({}), Tone{});
  v1::Tone tone;
  tone.set_curve(v1::Tone::REINHARD);
  tone.set_exposure_stops(-1);
  tone.set_white(2);
  EXPECT_EQ(*ToneFromMessage(tone), (Tone{.exposure_stops = -1, .curve = ToneCurve::kReinhard, .white = 2}));
  tone.set_curve(static_cast<v1::Tone::Curve>(9));
  EXPECT_EQ(ToneFromMessage(tone).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera
