#include "btf/meso/tracer.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "btf/base/parallel.h"
#include "tests/btf/meso/reference_tracer.h"
#include "tests/btf/meso/small_fields.h"

namespace tessera {
namespace {

// Sample of texel (x, row) in ReadAll's layout.
float At(const BtfInfo& info, const std::vector<float>& samples, int x, int row, int channel, size_t view,
         size_t light) {
  return samples[(((static_cast<size_t>(row) * info.width + x) * 3 + channel) * info.views.size() + view) *
                     info.lights.size() +
                 light];
}

std::vector<float> TraceAll(const SurfaceMaps& maps, const BtfInfo& info, const TraceOptions& options) {
  auto source = TraceHeightField(maps, info, options, {});
  EXPECT_TRUE(source.ok()) << source.status();
  return source.ok() ? ReadAll(**source) : std::vector<float>{};
}

TEST(TracerTest, AFlatWhiteDiffuserReadsTheCosine) {
  const SurfaceMaps maps = FlatField(4, 1.0F, 1.0F, 0.0F);
  const BtfInfo info = InfoFor(maps, UboDirections(),
                               {DirectionFromDeg(0, 0), DirectionFromDeg(60, 10), DirectionFromDeg(75, 200),
                                DirectionFromDeg(89, 90)});
  const std::vector<float> samples = TraceAll(maps, info, {});
  constexpr float kFloatError = 2e-6F;
  for (size_t view = 0; view < info.views.size(); ++view) {
    for (int texel = 0; texel < 16; ++texel) {
      const auto value = [&](size_t light) {
        return At(info, samples, texel % 4, texel / 4, 1, view, light);
      };
      EXPECT_NEAR(value(0), 1.0F, kFloatError);
      EXPECT_NEAR(value(1), 0.5F, kFloatError);
      EXPECT_NEAR(value(2), std::cos(info.lights[2].theta_rad), kFloatError);
      EXPECT_NEAR(value(3), std::cos(info.lights[3].theta_rad), kFloatError);
    }
  }
}

// A white surface with a lobe and one without reflects all of a white sky, seen from anywhere.
TEST(TracerTest, AFlatWhiteSurfaceReflectsExactlyWhatArrives) {
  constexpr int kLights = 4000;
  constexpr double kQuadratureError = 0.02;  // the lobe of roughness 0.3 at grazing views
  for (const float f0 : {0.0F, 0.04F, 0.6F}) {
    const SurfaceMaps maps = FlatField(2, 1.0F, 0.4F, f0);
    const BtfInfo info =
        InfoFor(maps, {DirectionFromDeg(0, 0), DirectionFromDeg(45, 30), DirectionFromDeg(75, 100)},
                SpiralDirections(kLights));
    const std::vector<float> samples = TraceAll(maps, info, {.area_samples = 1});
    for (size_t view = 0; view < info.views.size(); ++view) {
      double albedo = 0.0;  // 1 / pi times the integral of the value over the lights
      for (size_t light = 0; light < info.lights.size(); ++light) {
        albedo += 2.0 / kLights * At(info, samples, 0, 0, 0, view, light);
      }
      EXPECT_NEAR(albedo, 1.0, kQuadratureError) << "f0 " << f0 << ", view " << view;
    }
  }
}

// A texel's light from an all-white sky is the radiance one ray would bring: at most 1, whatever the relief.
TEST(TracerTest, NoTexelReflectsMoreThanArrives) {
  constexpr int kLights = 700;
  // 700 lights, and 64 rays per facet for what comes back: one texel sees few facets at a grazing view.
  constexpr double kTexelNoise = 0.07;
  constexpr double kMeanNoise = 0.005;
  for (const float f0 : {0.0F, 0.08F}) {
    SurfaceMaps maps = HillyField(8, 2, 4.0F, 0.45F, f0);
    std::fill(maps.albedo.begin(), maps.albedo.end(), 1.0F);
    const BtfInfo info =
        InfoFor(maps, {DirectionFromDeg(0, 0), DirectionFromDeg(50, 75), DirectionFromDeg(75, 290)},
                SpiralDirections(kLights));
    const std::vector<float> samples = TraceAll(maps, info, {.area_samples = 64, .bounces = 16});
    double total = 0.0;
    for (int texel = 0; texel < 64; ++texel) {
      for (size_t view = 0; view < info.views.size(); ++view) {
        double albedo = 0.0;
        for (size_t light = 0; light < info.lights.size(); ++light) {
          const double value = At(info, samples, texel % 8, texel / 8, 2, view, light);
          EXPECT_GE(value, 0.0);
          albedo += 2.0 / kLights * value;
        }
        EXPECT_LE(albedo, 1.0 + kTexelNoise);
        total += albedo / (64.0 * static_cast<double>(info.views.size()));
      }
    }
    // Without a lobe nothing is left out: after 16 bounces nearly all light has come back. With one, what is
    // mirrored into another slope is.
    EXPECT_GT(total, f0 == 0.0F ? 0.985 : 0.85);
    EXPECT_LE(total, 1.0 + kMeanNoise);
  }
}

TEST(TracerTest, MoreBouncesBringMoreLight) {
  const SurfaceMaps maps = HillyField(8, 1, 4.0F, 1.0F, 0.04F);
  const BtfInfo info = InfoFor(maps, {DirectionFromDeg(0, 0)}, {DirectionFromDeg(60, 45)});
  double last = 0.0;
  for (const int bounces : {0, 1, 2, 4}) {
    const std::vector<float> samples = TraceAll(maps, info, {.bounces = bounces});
    const double sum = std::accumulate(samples.begin(), samples.end(), 0.0);
    EXPECT_GT(sum, last * 1.001);
    last = sum;
  }
}

// A plane two texels above the reference plane, one column painted: it shifts by 2 tan(theta) against the
// view.
TEST(TracerTest, WhatStandsAboveTheReferencePlaneShiftsAgainstTheView) {
  SurfaceMaps maps = FlatField(12, 0.0F, 1.0F, 0.0F);
  maps.cells_per_texel = 2;
  const int n = maps.resolution();
  maps.height.assign(static_cast<size_t>(n) * n, 2.0F);
  maps.roughness.assign(static_cast<size_t>(n) * n, 1.0F);
  maps.albedo.assign(static_cast<size_t>(3) * n * n, 0.0F);
  for (const int j : {10, 11, 12}) {    // texel row 5
    for (const int i : {12, 13, 14}) {  // texel column 6
      std::fill_n(maps.albedo.begin() + 3 * (static_cast<std::ptrdiff_t>(j) * n + i), 3, 1.0F);
    }
  }
  const BtfInfo info = InfoFor(maps,
                               {DirectionFromDeg(0, 0), DirectionFromDeg(45, 0), DirectionFromDeg(45, 90),
                                DirectionFromDeg(45, 180), DirectionFromDeg(45, 270)},
                               {DirectionFromDeg(0, 0)});
  const std::vector<float> samples = TraceAll(maps, info, {.area_samples = 64});
  // Eye to the east (azimuth 0): the spot moves west. Eye to the north (90, up): it moves south, down the
  // rows.
  const int expected[][2] = {{6, 5}, {4, 5}, {6, 7}, {8, 5}, {6, 3}};
  for (size_t view = 0; view < info.views.size(); ++view) {
    int best_x = 0;
    int best_row = 0;
    for (int texel = 0; texel < 144; ++texel) {
      if (At(info, samples, texel % 12, texel / 12, 0, view, 0) >
          At(info, samples, best_x, best_row, 0, view, 0)) {
        best_x = texel % 12;
        best_row = texel / 12;
      }
    }
    EXPECT_EQ(best_x, expected[view][0]) << "view " << view;
    EXPECT_EQ(best_row, expected[view][1]) << "view " << view;
  }
}

TEST(TracerTest, SlopesFacingTheLightAreBrighterAndCastShadows) {
  SurfaceMaps maps = FlatField(16, 0.8F, 1.0F, 0.0F);
  for (int j = 0; j < 16; ++j) {  // a cone of height 4 at the centre
    for (int i = 0; i < 16; ++i) {
      maps.height[static_cast<size_t>(j) * 16 + i] =
          static_cast<float>(std::max(0.0, 4.0 - 1.3 * std::hypot(i - 8.0, j - 8.0)));
    }
  }
  const BtfInfo info =
      InfoFor(maps, {DirectionFromDeg(0, 0)},
              {DirectionFromDeg(60, 0), DirectionFromDeg(60, 90), DirectionFromDeg(60, 180)});
  const std::vector<float> samples = TraceAll(maps, info, {.bounces = 0});
  const auto value = [&](int x, int row, size_t light) { return At(info, samples, x, row, 0, 0, light); };
  EXPECT_GT(value(9, 8, 0), value(6, 8, 0) + 0.3F);  // light from the east: the east flank
  EXPECT_GT(value(6, 8, 2), value(9, 8, 2) + 0.3F);  // from the west: the west flank
  EXPECT_GT(value(8, 6, 1), value(8, 9, 1) + 0.3F);  // from the north: the flank towards row 0
  EXPECT_EQ(value(4, 8, 0), 0.0F);                   // flat ground west of the cone lies in its shadow
  EXPECT_NEAR(value(13, 8, 0), 0.4F, 1e-5F);         // 0.8 cos 60 on open ground
}

// Both estimate the same integral. The tracer's mean over kSeeds independent seeds and the reference's mean
// over its paths have standard errors; the difference over their root sum must look like a standard normal
// variable, but for kBias: the tracer keeps visibility and irradiance constant over parts and facets, which
// moves shadow edges by a fraction of a facet whatever the seed.
TEST(TracerTest, AgreesWithTheReferenceWithinItsNoise) {
  constexpr int kSeeds = 6;
  constexpr int kPaths = 900;
  constexpr int kSize = 8;
  constexpr double kBias = 0.004;
  constexpr double kMaxMeanBias = 0.001;
  const SurfaceMaps maps = HillyField(kSize, 4, 3.0F, 0.4F, 0.06F);
  const BtfInfo info =
      InfoFor(maps, {DirectionFromDeg(0, 0), DirectionFromDeg(45, 60), DirectionFromDeg(75, 200)},
              {DirectionFromDeg(0, 0), DirectionFromDeg(30, 300), DirectionFromDeg(60, 135),
               DirectionFromDeg(75, 20)});
  std::vector<std::vector<float>> runs;
  for (int seed = 0; seed < kSeeds; ++seed) {
    runs.push_back(
        TraceAll(maps, info, {.area_samples = 256, .bounces = 2, .seed = static_cast<uint64_t>(seed) + 1}));
  }
  std::vector<Eigen::Vector3d> lights;
  for (const Direction& light : info.lights) {
    lights.push_back(VectorFromDirection(light));
  }
  const ReferenceTracer reference(maps);
  const size_t num_views = info.views.size();
  std::vector<ReferenceEstimate> expected(kSize * kSize * num_views);
  ParallelFor({}, 0, static_cast<int64_t>(expected.size()), 1, [&](int64_t begin, int64_t) {
    const auto texel = static_cast<int>(begin / static_cast<int64_t>(num_views));
    const Eigen::Vector3d wo = VectorFromDirection(info.views[begin % num_views]);
    expected[begin] = reference.Texel(texel % kSize, texel / kSize, wo, lights, 2, kPaths, 77 + begin);
  });
  int count = 0;
  int beyond_two = 0;
  double worst = 0.0;
  double mean_difference = 0.0;
  for (int texel = 0; texel < kSize * kSize; ++texel) {
    for (size_t view = 0; view < num_views; ++view) {
      for (size_t light = 0; light < lights.size(); ++light) {
        for (int c = 0; c < 3; ++c) {
          double sum = 0.0;
          double squares = 0.0;
          for (const auto& run : runs) {
            const double value = At(info, run, texel % kSize, texel / kSize, c, view, light);
            sum += value / kSeeds;
            squares += value * value / kSeeds;
          }
          const double own_variance = std::max(0.0, squares - sum * sum) / (kSeeds - 1);
          const ReferenceEstimate& estimate = expected[texel * num_views + view];
          const double error = estimate.standard_error[light][c];
          const double difference = sum - estimate.mean[light][c];
          const double z =
              std::max(0.0, std::abs(difference) - kBias) / std::sqrt(own_variance + error * error + 1e-12);
          worst = std::max(worst, z);
          beyond_two += z > 2.0 ? 1 : 0;
          mean_difference += difference;
          ++count;
        }
      }
    }
  }
  mean_difference /= count;
  RecordProperty("worst_standard_errors", std::to_string(worst));
  EXPECT_LT(worst, 4.5);  // 4.5 sigma: 7e-6 per value, 1.6% over all 2304
  EXPECT_LT(beyond_two, 0.05 * count);
  EXPECT_LT(std::abs(mean_difference), kMaxMeanBias);
}

TEST(TracerTest, TheSamplesDependOnNeitherThreadsNorBlocksOfRows) {
  const SurfaceMaps maps = HillyField(12, 2, 4.0F, 0.5F, 0.05F);
  const BtfInfo info =
      InfoFor(maps, {DirectionFromDeg(0, 0), DirectionFromDeg(75, 33)},
              {DirectionFromDeg(15, 0), DirectionFromDeg(60, 200), DirectionFromDeg(75, 310)});
  std::vector<float> first;
  for (const int threads : {1, 2, 8}) {
    const RunContext context{.num_threads = threads};
    auto source = TraceHeightField(maps, info, {}, context);
    ASSERT_TRUE(source.ok()) << source.status();
    const std::vector<float> whole = ReadAll(**source, context);
    std::vector<float> blocks(whole.size());
    const size_t row = (*source)->SamplesPerRow();
    for (int begin = 0; begin < 12; begin += 5) {
      const int rows = std::min(5, 12 - begin);
      ASSERT_TRUE(
          (*source)->ReadRows(begin, rows, std::span(blocks).subspan(begin * row, rows * row), context).ok());
    }
    EXPECT_EQ(whole, blocks);
    if (first.empty()) {
      first = whole;
    }
    EXPECT_EQ(whole, first) << threads << " threads";
  }
  EXPECT_NE(first, TraceAll(maps, info, {.seed = 2}));
}

TEST(TracerTest, RefusesRowsAndBuffersThatDoNotFit) {
  const SurfaceMaps maps = FlatField(4, 1.0F, 1.0F, 0.0F);
  auto source =
      TraceHeightField(maps, InfoFor(maps, {DirectionFromDeg(0, 0)}, {DirectionFromDeg(0, 0)}), {}, {});
  ASSERT_TRUE(source.ok()) << source.status();
  std::vector<float> rows((*source)->SamplesPerRow() * 2);
  EXPECT_EQ((*source)->ReadRows(3, 2, rows, {}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ((*source)->ReadRows(-1, 2, rows, {}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ((*source)->ReadRows(0, 1, rows, {}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE((*source)->ReadRows(2, 2, rows, {}).ok());
}

}  // namespace
}  // namespace tessera
