#include "btf/image/tone_map.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

using ::testing::HasSubstr;

Image Pixels(std::vector<float> values, int channels) {
  Image image(static_cast<int>(values.size()) / channels, 1, channels);
  image.pixels = std::move(values);
  return image;
}

std::vector<float> Toned(const Tone& tone, std::vector<float> values, int channels = 3) {
  Image image = Pixels(std::move(values), channels);
  const absl::Status status = ApplyTone(tone, image);
  EXPECT_TRUE(status.ok()) << status;
  return image.pixels;
}

TEST(ToneMap, WithoutSettingsNothingChanges) {
  const std::vector<float> values = {-0.5f, 0.1f, 7.0f, 0.25f};
  EXPECT_EQ(Toned({}, values, 4), values);
}

TEST(ToneMap, AStopDoublesLightAndLeavesCoverage) {
  EXPECT_EQ(Toned({.exposure_stops = 1.0}, {0.1f, 0.2f, 3.0f, 0.5f}, 4),
            (std::vector<float>{0.2f, 0.4f, 6.0f, 0.5f}));
  EXPECT_EQ(Toned({.exposure_stops = -2.0}, {1.0f}, 1), (std::vector<float>{0.25f}));
}

TEST(ToneMap, ReinhardMapsWhiteToOneAndKeepsHue) {
  const Tone tone{.curve = ToneCurve::kReinhard, .white = 3.0};
  EXPECT_NEAR(Toned(tone, {3.0f, 3.0f, 3.0f})[1], 1.0f, 1e-6f);
  // Small values stay about as they are: 0.01 (1 + 0.01 / 9) / 1.01.
  EXPECT_NEAR(Toned(tone, {0.01f}, 1)[0], 0.00991197f, 1e-7f);
  const std::vector<float> colour = Toned(tone, {2.0f, 1.0f, 0.5f});
  EXPECT_NEAR(colour[0] / colour[1], 2.0f, 1e-5f);
  EXPECT_NEAR(colour[1] / colour[2], 2.0f, 1e-5f);
  // 0.2126 * 2 + 0.7152 + 0.0361 = 1.1765 is mapped by the formula.
  const double luminance = 0.2126 * colour[0] + 0.7152 * colour[1] + 0.0722 * colour[2];
  EXPECT_NEAR(luminance, 1.1765 * (1.0 + 1.1765 / 9.0) / 2.1765, 1e-6);
  // Exposure comes first.
  EXPECT_NEAR(Toned({.exposure_stops = 1.0, .curve = ToneCurve::kReinhard, .white = 3.0}, {1.5f}, 1)[0], 1.0f,
              1e-6f);
}

TEST(ToneMap, FilmicIsTheFormulaAndRisesToOne) {
  const Tone tone{.curve = ToneCurve::kFilmic};
  EXPECT_NEAR(Toned(tone, {0.18f}, 1)[0], 0.26689892f, 1e-6f);
  EXPECT_NEAR(Toned(tone, {1.0f}, 1)[0], 2.54f / 3.16f, 1e-6f);
  float last = -1.0f;
  for (float value = 0.0f; value < 20.0f; value += 0.01f) {
    const float mapped = Toned(tone, {value}, 1)[0];
    ASSERT_GE(mapped, last);
    ASSERT_LE(mapped, 1.0f);
    last = mapped;
  }
  EXPECT_EQ(last, 1.0f);
}

TEST(ToneMap, TakesValuesThatAreNoneAndRefusesSettingsOutOfRange) {
  const float infinite = std::numeric_limits<float>::infinity();
  for (const ToneCurve curve : {ToneCurve::kReinhard, ToneCurve::kFilmic}) {
    for (const float value : {infinite, -infinite, std::nanf(""), -1.0f, 3e38f}) {
      for (const float mapped : Toned({.exposure_stops = 20.0, .curve = curve}, {value, 0.5f, value})) {
        EXPECT_TRUE(std::isfinite(mapped) && mapped >= 0.0f) << value;
      }
    }
  }
  Image image = Pixels({0.5f}, 1);
  EXPECT_THAT(std::string(ApplyTone({.exposure_stops = 21.0}, image).message()), HasSubstr("exposure: 21"));
  EXPECT_FALSE(ApplyTone({.exposure_stops = std::nan("")}, image).ok());
  EXPECT_THAT(std::string(ApplyTone({.white = 0.0}, image).message()), HasSubstr("white: 0"));
  EXPECT_EQ(image.pixels[0], 0.5f);
  EXPECT_EQ(*ParseToneCurve("filmic"), ToneCurve::kFilmic);
  EXPECT_THAT(std::string(ParseToneCurve("aces").status().message()), HasSubstr("\"aces\""));
}

}  // namespace
}  // namespace tessera
