// Choices on small surfaces in closed form.
#include "btf/choice/encode_model.h"

#include <memory>
#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/reason.h"
#include "btf/codec/material.h"
#include "btf/data/direction_sets.h"
#include "btf/data/memory_btf.h"
#include "btf/measure/held_out.h"
#include "btf/stability/analytic_btf.h"

namespace tessera {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::unique_ptr<MemoryBtf> Surface(double specular = 0.3, const char* views = "3x8",
                                   const char* lights = "3x7") {
  const AnalyticSurface surface{.width = 26, .height = 24, .shininess = 10.0, .specular = specular};
  BtfInfo info{.width = 26, .height = 24, .views = *DirectionSet(views), .lights = *DirectionSet(lights)};
  std::vector<float> samples = AnalyticSamples(surface, info.views, info.lights);
  return *MemoryBtf::Create(std::move(info), std::move(samples));
}

ModelRequest WithinError(double max_error) {
  return {.codec = kAutoCodec, .params = {.max_error = max_error}};
}
ModelRequest WithinBytes(uint64_t max_bytes) {
  return {.codec = kAutoCodec, .params = {.max_bytes = max_bytes}};
}

uint64_t BytesOf(const Material& material) {
  return SerializeMaterial(material)->size();
}
double ErrorOf(const Material& material) {
  const nlohmann::json& chosen = material.metadata["choice"]["chosen"];
  return std::max(chosen["held_out_lights_rmse"].get<double>(), chosen["held_out_views_rmse"].get<double>());
}

TEST(EncodeModelTest, MeetsTheBoundAndATighterOneTakesMoreBytes) {
  const auto btf = Surface();
  uint64_t bytes = 0;
  for (const double max_error : {0.12, 0.045, 0.027}) {
    const auto material = EncodeModel(*btf, WithinError(max_error), {});
    ASSERT_TRUE(material.ok()) << material.status();
    const nlohmann::json& choice = material->metadata["choice"];
    SCOPED_TRACE(choice.dump(2));
    EXPECT_LE(ErrorOf(*material), max_error);
    EXPECT_EQ(choice["chosen"]["codec"], material->btfels.codec_id);
    EXPECT_EQ(choice["chosen"]["bytes"], BytesOf(*material));
    EXPECT_GT(BytesOf(*material), bytes);
    bytes = BytesOf(*material);
    EXPECT_TRUE(material->metadata.contains("diagnosis"));
    EXPECT_EQ(choice["goal"]["max_error"], max_error);
    EXPECT_EQ(choice["goal"]["scene_light"], "point");
    EXPECT_THAT(choice["report"][0].get<std::string>(), HasSubstr("chose " + material->btfels.codec_id));
    EXPECT_GE(choice["report"].size(), 4U);
  }
}

TEST(EncodeModelTest, AnImpossibleBoundIsRefusedWithTheBestFigure) {
  const auto btf = Surface();
  const absl::Status status = EncodeModel(*btf, WithinError(1e-6), {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ReasonOf(status), "BOUND_NOT_REACHED");
  EXPECT_EQ(SubjectOf(status), "max_error");
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("1e-06"), HasSubstr("the best is 0.0"), HasSubstr("times the bound")));
  const absl::Status small = EncodeModel(*btf, WithinBytes(100), {}).status();
  EXPECT_EQ(ReasonOf(small), "BOUND_NOT_REACHED");
  EXPECT_EQ(SubjectOf(small), "max_bytes");
}

TEST(EncodeModelTest, FillsTheBytesThatItMayTake) {
  const auto btf = Surface();
  double error = 1.0;
  for (const uint64_t max_bytes : {12'000, 30'000, 200'000}) {
    const auto material = EncodeModel(*btf, WithinBytes(max_bytes), {});
    ASSERT_TRUE(material.ok()) << material.status();
    EXPECT_LE(BytesOf(*material), max_bytes);
    EXPECT_LE(ErrorOf(*material), error) << max_bytes;
    error = ErrorOf(*material);
  }
}

TEST(EncodeModelTest, AnEnvironmentGetsAModelThatProjects) {
  const auto btf = Surface();
  ModelRequest request = WithinError(0.06);
  request.scene_light = SceneLight::kEnvironment;
  const auto material = EncodeModel(*btf, request, {});
  ASSERT_TRUE(material.ok()) << material.status();
  EXPECT_NE(material->btfels.codec_id, "view-pca");
  EXPECT_EQ(material->metadata["choice"]["goal"]["scene_light"], "environment");
}

TEST(EncodeModelTest, ThreadsChangeNothing) {
  const auto btf = Surface();
  std::string first;
  for (const int threads : {1, 2, 8}) {
    RunContext context;
    context.num_threads = threads;
    const auto material = EncodeModel(*btf, WithinError(0.06), context);
    ASSERT_TRUE(material.ok()) << material.status();
    const std::string bytes = *SerializeMaterial(*material);
    if (first.empty()) {
      first = bytes;
    }
    EXPECT_EQ(bytes == first, true) << threads;
  }
}

TEST(EncodeModelTest, StopsWhileItChooses) {
  const auto btf = Surface();
  std::stop_source stop;
  RunContext context;
  context.stop = stop.get_token();
  int settings = 0;
  context.progress = [&](const Progress& progress) {
    if (progress.stage == "choose" && ++settings == 3) {
      stop.request_stop();
    }
  };
  EXPECT_EQ(EncodeModel(*btf, WithinError(0.05), context).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(settings, 3);
}

TEST(EncodeModelTest, LightsOrViewsAloneMayBeTooFew) {
  const auto one_view = Surface(0.3, "1x1", "3x7");
  const auto material = EncodeModel(*one_view, WithinError(0.1), {});
  ASSERT_TRUE(material.ok()) << material.status();
  EXPECT_FALSE(material->metadata["choice"]["chosen"].contains("held_out_views_rmse"));
  EXPECT_TRUE(material->metadata["choice"]["chosen"].contains("held_out_lights_rmse"));
  const auto few = Surface(0.3, "1x4", "2x2");
  const absl::Status status = EncodeModel(*few, WithinError(0.1), {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), AllOf(HasSubstr("4 views"), HasSubstr("4 lights")));
}

// The choice looks at 400 texels of 624, and, of dfmf, at the first components of a larger factorisation.
TEST(EncodeModelTest, TheSettingIsAsFarOffAsTheChoiceSays) {
  constexpr double kTolerance = 0.05;
  const auto btf = Surface();
  for (const double max_error : {0.12, 0.06}) {
    const auto material = EncodeModel(*btf, WithinError(max_error), {});
    ASSERT_TRUE(material.ok()) << material.status();
    const nlohmann::json& chosen = material->metadata["choice"]["chosen"];
    SCOPED_TRACE(chosen.dump(2));
    ASSERT_EQ(chosen["codec"], "dfmf");
    const auto errors =
        MeasureHeldOut(*btf, *FindCodec("dfmf"), {.rank = material->btfels.num_coefficients}, {}, {});
    ASSERT_TRUE(errors.ok()) << errors.status();
    const auto expect_near = [&](const char* key, double expected) {
      EXPECT_NEAR(chosen[key].get<double>(), expected, kTolerance * expected) << key;
    };
    expect_near("held_out_lights_rmse", *errors->lights_rmse);
    expect_near("held_out_views_rmse", *errors->views_rmse);
    expect_near("sampled_rmse", errors->sampled_rmse);
  }
}

TEST(CheckModelRequestTest, NamesWhatDoesNotBelongTogether) {
  const auto message = [](const ModelRequest& request) {
    const absl::Status status = CheckModelRequest(request);
    EXPECT_TRUE(status.ok() || ReasonOf(status) == "ARGUMENT_INVALID");
    return std::string(status.message());
  };
  EXPECT_EQ(message({}), "");
  EXPECT_EQ(message({.codec = "dfmf", .params = {.rank = 3}}), "");
  EXPECT_EQ(message({.codec = "dfmf", .params = {.max_bytes = 3}}), "");
  EXPECT_EQ(message(WithinError(0.1)), "");
  EXPECT_THAT(message({.codec = "jpeg"}), AllOf(HasSubstr("jpeg"), HasSubstr("view-pca"), HasSubstr("auto")));
  EXPECT_THAT(message({.codec = "dsh", .params = {.rank = 3}}),
              HasSubstr("rank is for dfmf, the codec is dsh"));
  EXPECT_THAT(message({.codec = "auto", .params = {.rank = 3}}), HasSubstr("rank is for dfmf"));
  EXPECT_THAT(message({.codec = "view-pca", .params = {.max_error = 0.1}}),
              HasSubstr("max_error is for dfmf and auto, the codec is view-pca"));
  EXPECT_THAT(message({.codec = "dsh-cls", .params = {.max_bytes = 10}}), HasSubstr("max_bytes is for"));
  EXPECT_THAT(message({.codec = "dfmf", .scene_light = SceneLight::kPoint}),
              HasSubstr("scene_light is for auto"));
  EXPECT_THAT(message({.codec = "dfmf", .params = {.rank = 3, .max_error = 0.1}}), HasSubstr("at most one"));
  EXPECT_THAT(message({.codec = "auto", .params = {.max_error = 0.1, .max_bytes = 9}}),
              HasSubstr("at most one"));
  EXPECT_THAT(message({.codec = "auto"}), HasSubstr("needs max_error or max_bytes"));
  EXPECT_THAT(message(WithinError(-0.1)), HasSubstr("max_error = -0.1"));
}

}  // namespace
}  // namespace tessera
