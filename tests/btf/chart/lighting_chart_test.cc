#include "btf/chart/lighting_chart.h"

#include <algorithm>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/data/direction_sets.h"
#include "btf/light/generated_environment.h"
#include "btf/render/offscreen_context.h"
#include "tests/support/noise_btf.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

const LightingPoint& PointOf(const LightingEnvironment& environment, LightingMethod method, int count) {
  const auto found = std::ranges::find_if(environment.points, [&](const LightingPoint& point) {
    return point.method == method && point.count == count;
  });
  EXPECT_NE(found, environment.points.end());
  return *found;
}

TEST(LightingChartTest, MoreLightsAndOrdersComeCloserToTheTruth) {
  NoiseBtf source(12, 12, *DirectionSet("2x5"), *DirectionSet("2x5"));
  const auto gl = CreateOsmesaContext();
  ASSERT_TRUE(gl.ok()) << gl.status();
  const std::vector<NamedEnvironment> environments = {{"sky", *GeneratedEnvironment("sky")},
                                                      {"sun", *GeneratedEnvironment("sun")}};
  const auto chart = ChartLighting("noise", source, environments, ChartSize::kQuick, **gl, {});
  ASSERT_TRUE(chart.ok()) << chart.status();
  EXPECT_GT(chart->one_light_s, 0.0);
  ASSERT_EQ(chart->environments.size(), 2U);
  for (const LightingEnvironment& environment : chart->environments) {
    SCOPED_TRACE(environment.name);
    EXPECT_GT(environment.shadow_cost, 0.02);
    const auto error = [&](LightingMethod method, int count) {
      return PointOf(environment, method, count).error;
    };
    EXPECT_LT(error(LightingMethod::kLights, 64), 0.5 * error(LightingMethod::kLights, 8));
    EXPECT_LT(error(LightingMethod::kFrequency, 5), error(LightingMethod::kFrequency, 2));
    // Only shadows come close to the truth with shadows.
    const LightingPoint& shadowed = PointOf(environment, LightingMethod::kShadowedLights, 64);
    EXPECT_LT(shadowed.shadowed_error, 0.5 * environment.shadow_cost);
    EXPECT_GT(shadowed.error, 0.5 * environment.shadow_cost);
    EXPECT_GT(PointOf(environment, LightingMethod::kFrequency, 5).shadowed_error,
              0.5 * environment.shadow_cost);
    EXPECT_EQ(environment.pictures.size(), 5U);
  }
  const std::string csv = LightingCsv({*chart});
  EXPECT_EQ(std::ranges::count(csv, '\n'), 1 + 2 * 6);
  const auto html = LightingHtml({*chart});
  ASSERT_TRUE(html.ok()) << html.status();
  EXPECT_THAT(*html, HasSubstr("<svg"));
  EXPECT_THAT(*html, HasSubstr("noise, sun"));

  EXPECT_EQ(ChartLighting("noise", source, {}, ChartSize::kQuick, **gl, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(ChartLighting("noise", source, environments, ChartSize::kQuick, **gl, {.stop = stop.get_token()})
                .status()
                .code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
