#include "btf/meso/procedural_maps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stop_token>
#include <vector>

#include <gtest/gtest.h>

#include "btf/meso/periodic_noise.h"

namespace tessera {
namespace {

using Maker = absl::StatusOr<SurfaceMaps> (*)(const MapParams&, const RunContext&);

struct Kind {
  const char* name;
  Maker make;
};

constexpr Kind kKinds[] = {{"reactdiffuse", MakeReactDiffuse},
                           {"holes", MakeHoles},
                           {"wrinkles", MakeWrinkles},
                           {"weave", MakeWeave}};

SurfaceMaps Make(const Kind& kind, uint64_t seed, int size = 128) {
  auto maps = kind.make({.size = size, .cells_per_texel = 2, .seed = seed}, {});
  EXPECT_TRUE(maps.ok()) << maps.status();
  return *std::move(maps);
}

// One channel of a map, as a field of n x n.
std::vector<float> Channel(const SurfaceMaps& maps, int channel) {
  if (channel < 0) {
    return maps.height;
  }
  std::vector<float> values;
  for (size_t i = channel; i < maps.albedo.size(); i += 3) {
    values.push_back(maps.albedo[i]);
  }
  return values;
}

// The structure tensor of the gradients of a periodic field, summed: Jxx, Jyy, Jxy.
struct Tensor {
  double xx = 0.0;
  double yy = 0.0;
  double xy = 0.0;
  void Add(const std::vector<float>& field, int n) {
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        const auto at = [&](int a, int b) {
          return field[static_cast<size_t>((b + n) % n) * n + (a + n) % n];
        };
        const double gx = (at(i + 1, j) - at(i - 1, j)) / 2.0;
        const double gy = (at(i, j - 1) - at(i, j + 1)) / 2.0;
        xx += gx * gx;
        yy += gy * gy;
        xy += gx * gy;
      }
    }
  }
  // 0 where gradients are alike in all directions, 1 where all share one.
  [[nodiscard]] double Anisotropy() const { return std::hypot(xx - yy, 2.0 * xy) / (xx + yy); }
};

TEST(ProceduralMapsTest, MapsAreCompleteAndWithinTheirRanges) {
  for (const Kind& kind : kKinds) {
    const SurfaceMaps maps = Make(kind, 3, 64);
    const size_t count = 128 * 128;
    ASSERT_EQ(maps.height.size(), count) << kind.name;
    ASSERT_EQ(maps.albedo.size(), 3 * count) << kind.name;
    ASSERT_EQ(maps.roughness.size(), count) << kind.name;
    for (const float albedo : maps.albedo) {
      ASSERT_TRUE(albedo >= 0.0F && albedo <= 0.95F) << kind.name << " " << albedo;
    }
    for (const float roughness : maps.roughness) {
      ASSERT_TRUE(roughness >= 0.2F && roughness <= 1.0F) << kind.name << " " << roughness;
    }
    const auto [low, high] = std::minmax_element(maps.height.begin(), maps.height.end());
    EXPECT_GT(*high - *low, 2.0F) << kind.name;
    EXPECT_LT(*high - *low, 8.0F) << kind.name;
  }
}

TEST(ProceduralMapsTest, TheHeightScaleIsTheRange) {
  for (const Kind& kind : kKinds) {
    auto maps = kind.make({.size = 32, .cells_per_texel = 1, .height_scale_texels = 2.5}, {});
    ASSERT_TRUE(maps.ok()) << maps.status();
    const auto [low, high] = std::minmax_element(maps->height.begin(), maps->height.end());
    EXPECT_NEAR(*high - *low, 2.5F, 1e-4F) << kind.name;
  }
}

TEST(ProceduralMapsTest, SameSeedSameMapsOtherSeedOtherMaps) {
  for (const Kind& kind : kKinds) {
    const SurfaceMaps a = Make(kind, 5, 48);
    const SurfaceMaps b = Make(kind, 5, 48);
    const SurfaceMaps c = Make(kind, 6, 48);
    EXPECT_EQ(a.height, b.height) << kind.name;
    EXPECT_EQ(a.albedo, b.albedo) << kind.name;
    EXPECT_EQ(a.roughness, b.roughness) << kind.name;
    EXPECT_NE(a.height, c.height) << kind.name;
  }
}

// The step across the border is no larger than the largest between two columns or rows inside: the border of
// a yarn may lie there, but nothing else.
TEST(ProceduralMapsTest, FieldsContinueAcrossTheirBorders) {
  constexpr double kSlack = 1.25;  // the borders of yarns differ by their own shades
  for (const Kind& kind : kKinds) {
    for (const int size : {50, 64}) {
      const SurfaceMaps maps = Make(kind, 11, size);
      const int n = maps.resolution();
      for (int channel = -1; channel < 3; ++channel) {
        const std::vector<float> field = Channel(maps, channel);
        for (const bool along_x : {true, false}) {
          std::vector<double> steps(n);  // from column or row a to the next
          for (int a = 0; a < n; ++a) {
            for (int b = 0; b < n; ++b) {
              const int next = (a + 1) % n;
              steps[a] += along_x ? std::abs(field[static_cast<size_t>(b) * n + next] -
                                             field[static_cast<size_t>(b) * n + a])
                                  : std::abs(field[static_cast<size_t>(next) * n + b] -
                                             field[static_cast<size_t>(a) * n + b]);
            }
          }
          EXPECT_LT(steps[n - 1], kSlack * *std::max_element(steps.begin(), steps.end() - 1))
              << kind.name << " size " << size << " channel " << channel << (along_x ? " x" : " y");
        }
      }
    }
  }
}

// Turned strips presume it (surface-* arrangements). One exemplar of 128 texels holds about a hundred
// features, so chance alone leaves 0.1; pooled over seeds it must fall. The same measure sees a stretched
// field.
TEST(ProceduralMapsTest, ReactDiffuseWrinklesAndHolesAreIsotropic) {
  constexpr double kOneExemplar = 0.2;
  constexpr double kPooled = 0.08;
  constexpr int kSeeds = 4;
  constexpr int kChannels[] = {-1, 0, 2};
  for (const int k : {0, 1, 2}) {
    std::array<Tensor, 3> pooled;
    for (uint64_t seed = 1; seed <= kSeeds; ++seed) {
      const SurfaceMaps maps = Make(kKinds[k], seed);
      for (int c = 0; c < 3; ++c) {
        Tensor one;
        one.Add(Channel(maps, kChannels[c]), maps.resolution());
        pooled[c].Add(Channel(maps, kChannels[c]), maps.resolution());
        EXPECT_LT(one.Anisotropy(), kOneExemplar)
            << kKinds[k].name << " seed " << seed << " channel " << kChannels[c];
      }
    }
    for (int c = 0; c < 3; ++c) {
      EXPECT_LT(pooled[c].Anisotropy(), kPooled) << kKinds[k].name << " channel " << kChannels[c];
      const double ratio = std::sqrt(pooled[c].xx / pooled[c].yy);  // RMS slope along x over that along y
      EXPECT_NEAR(ratio, 1.0, kPooled) << kKinds[k].name << " channel " << kChannels[c];
    }
  }
  const PeriodicField noise = BandNoise(128, 14.0, 0.3, 1);
  PeriodicField stretched(128);
  for (int j = 0; j < 128; ++j) {
    for (int i = 0; i < 128; ++i) {
      stretched.values[static_cast<size_t>(j) * 128 + i] = noise.Cubic(2.0 * i, j);
    }
  }
  Tensor tensor;
  tensor.Add(stretched.values, 128);
  EXPECT_GT(tensor.Anisotropy(), 0.4);
}

// Strips of 16 texels hold a feature: the height decorrelates within 2 to 8 texels, half a feature,
// whatever the size.
TEST(ProceduralMapsTest, FeaturesKeepTheirScaleInTexels) {
  for (const Kind& kind : kKinds) {
    for (const int size : {64, 160}) {
      const SurfaceMaps maps = Make(kind, 2, size);
      const int n = maps.resolution();
      double mean = 0.0;
      for (const float z : maps.height) {
        mean += z / static_cast<double>(maps.height.size());
      }
      const auto covariance = [&](int lag) {
        double sum = 0.0;
        for (int j = 0; j < n; ++j) {
          for (int i = 0; i < n; ++i) {
            const double z = maps.height[static_cast<size_t>(j) * n + i] - mean;
            sum += z * (maps.height[static_cast<size_t>(j) * n + (i + lag) % n] - mean) +
                   z * (maps.height[static_cast<size_t>((j + lag) % n) * n + i] - mean);
          }
        }
        return sum;
      };
      const double variance = covariance(0);
      double texels = 0.0;
      for (int lag = 1; lag < 32; ++lag) {
        if (covariance(lag) < 0.2 * variance) {
          texels = lag / 2.0;
          break;
        }
      }
      EXPECT_GE(texels, 2.0) << kind.name << " size " << size;
      EXPECT_LE(texels, 8.0) << kind.name << " size " << size;
    }
  }
}

// Worms longer than a strip of 16 texels is high are cut off where tiles meet. The longer side of the box
// around each ridge, in texels, averaged over the area of ridges: 13 here, 20 for the coarser reaction of
// before.
TEST(ProceduralMapsTest, RidgesOfReactDiffuseFitStripsOf16Texels) {
  constexpr double kRidge = 0.6;  // of the range of heights
  for (const uint64_t seed : {1, 2}) {
    const SurfaceMaps maps = Make(kKinds[0], seed);
    const int n = maps.resolution();
    const auto [low, high] = std::minmax_element(maps.height.begin(), maps.height.end());
    const float level = static_cast<float>(*low + kRidge * (*high - *low));
    std::vector<uint8_t> seen(maps.height.size(), 0);
    double length = 0.0;
    double area = 0.0;
    for (int start = 0; start < n * n; ++start) {
      std::vector<std::array<int, 2>> ridge;  // grows past the border of the map, so that boxes are whole
      const auto visit = [&](int x, int y) {
        const int at = (y + 4 * n) % n * n + (x + 4 * n) % n;
        if (maps.height[at] > level && seen[at] == 0) {
          seen[at] = 1;
          ridge.push_back({x, y});
        }
      };
      visit(start % n, start / n);
      std::array<int, 4> box = {n, n, -n, -n};
      for (size_t i = 0; i < ridge.size(); ++i) {
        const auto [x, y] = ridge[i];
        box = {std::min(box[0], x), std::min(box[1], y), std::max(box[2], x), std::max(box[3], y)};
        visit(x + 1, y);
        visit(x - 1, y);
        visit(x, y + 1);
        visit(x, y - 1);
      }
      const auto texels = static_cast<double>(ridge.size());
      area += texels;
      length += texels * (std::max(box[2] - box[0], box[3] - box[1]) + 1) / 2.0;  // 2 cells a texel
    }
    ASSERT_GT(area, 0.0);
    EXPECT_LT(length / area, 18.0) << "seed " << seed;
  }
}

TEST(ProceduralMapsTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  for (const Kind& kind : kKinds) {
    EXPECT_EQ(kind.make({.size = 32}, {.stop = stop.get_token()}).status().code(),
              absl::StatusCode::kCancelled)
        << kind.name;
  }
}

TEST(BandNoiseTest, HasMeanZeroAndVarianceOne) {
  for (const double wavelength : {6.0, 14.0, 30.0}) {
    const PeriodicField noise = BandNoise(192, wavelength, 0.3, 9);
    double sum = 0.0;
    double squares = 0.0;
    for (const float v : noise.values) {
      sum += v;
      squares += v * v;
    }
    const auto count = static_cast<double>(noise.values.size());
    EXPECT_NEAR(sum / count, 0.0, 1e-3);
    EXPECT_NEAR(squares / count, 1.0, 0.15);  // waves that round to the same periods add up
  }
}

TEST(PeriodicFieldTest, CubicMeetsTheSamplesAndWraps) {
  const PeriodicField noise = BandNoise(16, 8.0, 0.2, 1);
  EXPECT_NEAR(noise.Cubic(3.0, 5.0), noise.values[5 * 16 + 3], 1e-6F);
  EXPECT_NEAR(noise.Cubic(3.25 + 16.0, 5.5 - 32.0), noise.Cubic(3.25, 5.5), 1e-6F);
}

TEST(BlueNoiseTest, PointsKeepTheirDistanceAcrossTheBorderAndFillTheTorus) {
  constexpr double kSize = 64.0;
  constexpr double kDistance = 9.0;
  const auto points = BlueNoisePoints(kSize, kDistance, 4);
  // Dart throwing packs discs of half the distance to 0.55 (jammed at random), here up to what 64 tries
  // reach.
  EXPECT_GT(static_cast<double>(points.size()) * 0.785 * kDistance * kDistance, 0.45 * kSize * kSize);
  for (size_t a = 0; a < points.size(); ++a) {
    for (size_t b = 0; b < a; ++b) {
      EXPECT_GE(std::hypot(TorusDifference(points[a][0], points[b][0], kSize),
                           TorusDifference(points[a][1], points[b][1], kSize)),
                kDistance);
    }
  }
}

}  // namespace
}  // namespace tessera
