#include "btf/meso/heightmap.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

using ::testing::HasSubstr;

Image Filled(int width, int height, int channels, float value) {
  Image image(width, height, channels);
  std::fill(image.pixels.begin(), image.pixels.end(), value);
  return image;
}

// The largest and the mean step between neighbours of a periodic field along x.
struct Steps {
  double largest_inside = 0.0;
  double largest_across = 0.0;
};
Steps StepsAlongX(const std::vector<float>& field, int n) {
  Steps steps;
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const double step =
          std::abs(field[static_cast<size_t>(j) * n + (i + 1) % n] - field[static_cast<size_t>(j) * n + i]);
      double& largest = i + 1 < n ? steps.largest_inside : steps.largest_across;
      largest = std::max(largest, step);
    }
  }
  return steps;
}

TEST(HeightmapTest, APeriodicImageStaysAsItIs) {
  Image height(64, 64, 1);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      *height.at(x, y) = static_cast<float>(0.5 + 0.5 * std::sin(2.0 * 3.14159265 * (x + 0.5) / 64.0));
    }
  }
  const auto maps =
      MapsFromImages({.size = 64, .cells_per_texel = 2}, height, Filled(64, 64, 3, 0.5F), nullptr);
  ASSERT_TRUE(maps.ok()) << maps.status();
  constexpr double kTentError = 0.02;  // of the scale: a tent one pixel wide flattens the wave a little
  for (int i = 0; i < 128; ++i) {
    EXPECT_NEAR(maps->height[static_cast<size_t>(17) * 128 + i],
                kHeightmapScale * (0.5 + 0.5 * std::sin(2.0 * 3.14159265 * i / 128.0)),
                kTentError * kHeightmapScale);
  }
  EXPECT_EQ(maps->roughness.front(), kHeightmapRoughness);
}

TEST(HeightmapTest, ARampIsBlendedUntilItRepeats) {
  Image height(80, 80, 1);
  Image colour(80, 80, 3);
  for (int y = 0; y < 80; ++y) {
    for (int x = 0; x < 80; ++x) {
      *height.at(x, y) = static_cast<float>(x) / 79.0F;
      for (int c = 0; c < 3; ++c) {
        colour.at(x, y)[c] = static_cast<float>(x) / 79.0F;
      }
    }
  }
  const auto maps = MapsFromImages({.size = 40, .cells_per_texel = 2}, height, colour, nullptr);
  ASSERT_TRUE(maps.ok()) << maps.status();
  const Steps steps = StepsAlongX(maps->height, 80);
  EXPECT_LE(steps.largest_across, steps.largest_inside * 1.01);
  // Without the blend the ramp would fall by its whole range in one step; the band spreads that over an
  // eighth.
  EXPECT_LT(steps.largest_across, 0.15 * kHeightmapScale);
  const auto [low, high] = std::minmax_element(maps->height.begin(), maps->height.end());
  EXPECT_GT(*high - *low, 0.7 * kHeightmapScale);
  // Along y the image repeats already and is left alone.
  for (int j = 0; j < 80; ++j) {
    EXPECT_NEAR(maps->height[static_cast<size_t>(j) * 80 + 33], maps->height[33], 1e-5F);
  }
}

TEST(HeightmapTest, RowZeroStaysOnTopAndColumnsRunEast) {
  Image height = Filled(64, 64, 1, 0.0F);
  for (int y = 8; y < 16; ++y) {
    for (int x = 40; x < 48; ++x) {
      *height.at(x, y) = 1.0F;
    }
  }
  const auto maps = MapsFromImages({.size = 32, .cells_per_texel = 2, .height_scale_texels = 3.0}, height,
                                   Filled(64, 64, 3, 0.5F), nullptr);
  ASSERT_TRUE(maps.ok()) << maps.status();
  EXPECT_NEAR(maps->height[static_cast<size_t>(12) * 64 + 44], 3.0F, 1e-5F);
  EXPECT_NEAR(maps->height[static_cast<size_t>(44) * 64 + 12], 0.0F, 1e-5F);
}

TEST(HeightmapTest, ImagesOfOtherResolutionAndShapeAreBroughtToOne) {
  // Twice as wide as high: the central square is taken.
  Image height = Filled(128, 64, 1, 0.2F);
  Image colour(256, 128, 4);
  for (int y = 0; y < 128; ++y) {
    for (int x = 0; x < 256; ++x) {
      const bool central = x >= 64 && x < 192;
      float* pixel = colour.at(x, y);
      pixel[0] = central ? 0.25F : 0.9F;
      pixel[1] = 0.5F;
      pixel[2] = 0.75F;
      pixel[3] = 3.0F;  // coverage is not read
    }
  }
  const Image roughness = Filled(64, 32, 1, 0.3F);
  const auto maps = MapsFromImages({.size = 33, .cells_per_texel = 1}, height, colour, &roughness);
  ASSERT_TRUE(maps.ok()) << maps.status();
  for (size_t vertex = 0; vertex < maps->height.size(); ++vertex) {
    ASSERT_NEAR(maps->albedo[3 * vertex], 0.25F, 1e-5F);
    ASSERT_NEAR(maps->albedo[3 * vertex + 1], 0.5F, 1e-5F);
    ASSERT_NEAR(maps->albedo[3 * vertex + 2], 0.75F, 1e-5F);
    ASSERT_NEAR(maps->roughness[vertex], 0.3F, 1e-5F);
    ASSERT_NEAR(maps->height[vertex], 0.2F * kHeightmapScale, 1e-4F);
  }
}

TEST(HeightmapTest, NamesWhatIsWrongWithAnImage) {
  const Image good = Filled(32, 32, 3, 0.5F);
  const MapParams params{.size = 32, .cells_per_texel = 1};
  const auto message = [&](const Image& height, const Image& colour, const Image* roughness) {
    const auto maps = MapsFromImages(params, height, colour, roughness);
    EXPECT_EQ(maps.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(maps.status().message());
  };
  Image broken = good;
  broken.at(7, 3)[0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(message(broken, good, nullptr),
              HasSubstr("height: pixel (7, 3) is nan, expected a finite number"));
  EXPECT_THAT(message(good, broken, nullptr), HasSubstr("colour: pixel (7, 3) is nan"));
  EXPECT_THAT(message(good, good, &broken), HasSubstr("roughness: pixel (7, 3) is nan"));
  broken.at(7, 3)[0] = 1.5F;
  EXPECT_THAT(message(good, broken, nullptr),
              HasSubstr("colour: pixel (7, 3) is 1.5, expected a value in [0, 1]"));
  Image truncated = good;
  truncated.pixels.pop_back();
  EXPECT_THAT(message(truncated, good, nullptr), HasSubstr("height: 32x32 with 3 channels and 3071 values"));
  EXPECT_THAT(message(Image(), good, nullptr), HasSubstr("height: 0x0"));
  EXPECT_THAT(message(good, Filled(64, 32, 3, 0.5F), nullptr),
              HasSubstr("colour: 64x32 has another aspect ratio"));
  Image steep = good;
  steep.at(3, 3)[0] = 500.0F;
  EXPECT_THAT(message(steep, good, nullptr), HasSubstr("expected at most size / 4 = 8"));
}

}  // namespace
}  // namespace tessera
