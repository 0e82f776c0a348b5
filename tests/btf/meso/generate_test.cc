#include "btf/meso/generate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/image/image_io.h"
#include "tests/btf/meso/small_fields.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

GenerateParams SmallParams(std::string kind) {
  GenerateParams params;
  params.kind = std::move(kind);
  params.size = 32;
  params.views = {DirectionFromDeg(0, 0), DirectionFromDeg(60, 45)};
  params.lights = {DirectionFromDeg(0, 0), DirectionFromDeg(45, 120), DirectionFromDeg(75, 300)};
  if (params.kind == "heightmap") {
    Image height(40, 40, 1);
    Image colour(40, 40, 3);
    for (int i = 0; i < 40 * 40; ++i) {
      height.pixels[i] =
          static_cast<float>(0.5 + 0.25 * std::sin(0.31 * (i % 40)) * std::cos(0.31 * (i / 40.0)));
      for (int c = 0; c < 3; ++c) {
        colour.pixels[3 * i + c] = 0.2F + 0.2F * static_cast<float>(c);
      }
    }
    params.height = height;
    params.colour = colour;
  }
  return params;
}

TEST(GenerateTest, EveryKindMakesPlausibleSamplesAndSaysWhereTheyCameFrom) {
  const auto kinds = GeneratorKinds();
  EXPECT_EQ(kinds.size(), 5U);
  for (const std::string_view kind : kinds) {
    const GenerateParams params = SmallParams(std::string(kind));
    auto source = GenerateBtf(params, {});
    ASSERT_TRUE(source.ok()) << source.status();
    const BtfInfo& info = (*source)->info();
    EXPECT_EQ(info.width, 32);
    EXPECT_EQ(info.height, 32);
    EXPECT_EQ(info.views.size(), 2U);
    EXPECT_EQ(info.lights.size(), 3U);
    EXPECT_EQ(info.provenance.source, "generated:" + std::string(kind) + ",size=32");
    EXPECT_EQ(info.provenance.licence, kind == "heightmap" ? "" : "CC0-1.0");
    EXPECT_FALSE(info.provenance.citation.empty());
    EXPECT_THAT(info.radiometry, HasSubstr("pi f_r cos(theta_i)"));
    const std::vector<float> samples = ReadAll(**source);
    ASSERT_FALSE(samples.empty());
    double sum = 0.0;
    for (const float value : samples) {
      ASSERT_TRUE(std::isfinite(value) && value >= 0.0F);
      sum += value;
    }
    const double mean = sum / static_cast<double>(samples.size());
    EXPECT_GT(mean, 0.03) << kind;
    EXPECT_LT(mean, 0.8) << kind;
  }
}

TEST(GenerateTest, TheSeedAloneDecidesTheSamples) {
  for (const std::string_view kind : GeneratorKinds()) {
    GenerateParams params = SmallParams(std::string(kind));
    std::vector<float> first;
    for (const int threads : {1, 2, 8}) {
      const RunContext context{.num_threads = threads};
      auto source = GenerateBtf(params, context);
      ASSERT_TRUE(source.ok()) << source.status();
      const std::vector<float> samples = ReadAll(**source, context);
      if (first.empty()) {
        first = samples;
      }
      EXPECT_EQ(samples, first) << kind << ", " << threads << " threads";
      EXPECT_EQ(ReadAll(**source, context), first) << kind << ", second pass";
    }
    params.seed = 2;
    auto other = GenerateBtf(params, {});
    ASSERT_TRUE(other.ok()) << other.status();
    EXPECT_NE(ReadAll(**other), first) << kind;
  }
}

TEST(GenerateTest, ReportsProgressForwardsToItsTotals) {
  std::string last_stage;
  uint64_t last_done = 0;
  bool complete = true;
  std::vector<std::string> stages;
  RunContext context;
  context.progress = [&](const Progress& progress) {
    if (progress.stage != last_stage) {
      last_stage = progress.stage;
      stages.emplace_back(progress.stage);
      last_done = 0;
    }
    EXPECT_GT(progress.done, last_done);
    EXPECT_LE(progress.done, progress.total);
    last_done = progress.done;
    complete = progress.done == progress.total;
  };
  auto source = GenerateBtf(SmallParams("reactdiffuse"), context);
  ASSERT_TRUE(source.ok()) << source.status();
  EXPECT_TRUE(complete);
  std::vector<float> rows((*source)->SamplesPerRow() * 16);
  ASSERT_TRUE((*source)->ReadRows(0, 16, rows, context).ok());
  ASSERT_TRUE((*source)->ReadRows(16, 16, rows, context).ok());
  EXPECT_TRUE(complete);
  EXPECT_THAT(stages, ::testing::ElementsAre("reaction", "visibility", "interreflections", "rows"));
}

TEST(GenerateTest, StopsInEveryStage) {
  for (const std::string stage : {"reaction", "visibility", "interreflections"}) {
    std::stop_source stop;
    RunContext context{.stop = stop.get_token()};
    context.progress = [&](const Progress& progress) {
      if (progress.stage == stage) {
        stop.request_stop();
      }
    };
    EXPECT_EQ(GenerateBtf(SmallParams("reactdiffuse"), context).status().code(), absl::StatusCode::kCancelled)
        << stage;
  }
  auto source = GenerateBtf(SmallParams("holes"), {});
  ASSERT_TRUE(source.ok()) << source.status();
  std::stop_source stop;
  stop.request_stop();
  std::vector<float> rows((*source)->SamplesPerRow());
  EXPECT_EQ((*source)->ReadRows(0, 1, rows, {.stop = stop.get_token()}).code(), absl::StatusCode::kCancelled);
}

// Photographed maps as artists have them: JPEG, colour in sRGB, height and roughness linear.
TEST(GenerateTest, TracesMapsReadFromFiles) {
  TESSERA_REQUIRE_DATA("textures/Rock031");
  const auto read = [](const std::string& what, Transfer transfer) {
    auto image = ReadImage(TestData("textures/Rock031/Rock031_1K-JPG_" + what + ".jpg"), transfer);
    EXPECT_TRUE(image.ok()) << image.status();
    return image.ok() ? *std::move(image) : Image();
  };
  GenerateParams params = SmallParams("weave");
  params.kind = "heightmap";
  params.size = 64;
  params.height = read("Displacement", Transfer::Linear());
  params.colour = read("Color", Transfer::Srgb());
  params.roughness = read("Roughness", Transfer::Linear());
  auto source = GenerateBtf(params, {});
  ASSERT_TRUE(source.ok()) << source.status();
  const std::vector<float> samples = ReadAll(**source);
  double colour_mean = 0.0;
  for (const float value : params.colour->pixels) {
    colour_mean += value / static_cast<double>(params.colour->pixels.size());
  }
  // Seen and lit along the normal, it is about as bright as its colour.
  double mean = 0.0;
  for (size_t texel_channel = 0; texel_channel < size_t{64} * 64 * 3; ++texel_channel) {
    mean += samples[texel_channel * 6] / (64.0 * 64.0 * 3.0);
  }
  EXPECT_GT(mean, 0.7 * colour_mean);
  EXPECT_LT(mean, 1.3 * colour_mean + 0.04);
}

TEST(GenerateTest, NamesTheParameterItRefuses) {
  const auto message = [](const GenerateParams& params) {
    const auto source = GenerateBtf(params, {});
    EXPECT_EQ(source.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(source.status().message());
  };
  GenerateParams params = SmallParams("lava");
  EXPECT_THAT(message(params), HasSubstr("generator kind \"lava\", expected one of reactdiffuse, holes"));
  params = SmallParams("holes");
  params.size = 31;
  EXPECT_THAT(message(params), HasSubstr("size 31, expected 32 to 1024"));
  params.size = 1025;
  EXPECT_THAT(message(params), HasSubstr("size 1025"));
  params = SmallParams("holes");
  params.views.clear();
  EXPECT_THAT(message(params), HasSubstr("views: 0 directions, expected 1 to 4096"));
  params = SmallParams("holes");
  params.lights[2] = DirectionFromDeg(89.5, 0);
  EXPECT_THAT(message(params), HasSubstr("light 2: polar angle 89.5 deg, expected 0 to 89"));
  params.lights[2] = {0.2, std::numeric_limits<double>::infinity()};
  EXPECT_THAT(message(params), HasSubstr("light 2: azimuth inf is not finite"));
  params = SmallParams("holes");
  params.views[1].theta_rad = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message(params), HasSubstr("view 1: polar angle nan"));
  params = SmallParams("holes");
  params.area_samples = 0;
  EXPECT_THAT(message(params), HasSubstr("area samples 0, expected 1 to 1024"));
  params = SmallParams("holes");
  params.bounces = 17;
  EXPECT_THAT(message(params), HasSubstr("bounces 17, expected 0 to 16"));
  params = SmallParams("holes");
  for (const double scale : {-1.0, 8.5, std::numeric_limits<double>::quiet_NaN()}) {
    params.height_scale_texels = scale;
    EXPECT_THAT(message(params), HasSubstr("expected 0 to size / 4 = 8"));
  }
  params = SmallParams("heightmap");
  params.height.reset();
  EXPECT_THAT(message(params), HasSubstr("kind heightmap needs a height image"));
  params = SmallParams("heightmap");
  params.colour.reset();
  EXPECT_THAT(message(params), HasSubstr("kind heightmap needs a colour image"));
  params = SmallParams("weave");
  params.roughness = Image(2, 2, 1);
  EXPECT_THAT(message(params), HasSubstr("kind weave takes no images"));
}

TEST(GenerateTest, RefusesWhatWouldNotFitInMemoryBeforeItStarts) {
  GenerateParams params = SmallParams("holes");
  params.size = 1024;
  params.lights = SpiralDirections(600);
  for (Direction& light : params.lights) {
    light.theta_rad = std::min(light.theta_rad, RadFromDeg(85.0));
  }
  const auto source = GenerateBtf(params, {});
  EXPECT_EQ(source.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(source.status().message()), HasSubstr("limit 8192 MiB"));
}

}  // namespace
}  // namespace tessera
