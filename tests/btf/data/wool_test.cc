// The measured wool of UBO2003: 6,561 JPEG images in one archive.
#include <chrono>
#include <cmath>
#include <complex>
#include <cstdio>
#include <vector>

#include <gtest/gtest.h>

#include "btf/data/direction_sets.h"
#include "btf/data/import.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

TEST(WoolTest, ImportsAllImagesAndDirections) {
  TESSERA_REQUIRE_DATA(kWool);
  const auto begin = std::chrono::steady_clock::now();
  const auto source =
      ImportBtf(TestData(kWool), {.transfer = Transfer{TransferKind::kGamma, 2.2}}, RunContext{});
  ASSERT_TRUE(source.ok()) << source.status();
  const auto imported = std::chrono::steady_clock::now();
  const BtfInfo& info = (*source)->info();
  EXPECT_EQ(info.width, 128);
  EXPECT_EQ(info.height, 128);
  const std::vector<Direction> expected = DirectionSet("ubo81").value();
  for (const auto& directions : {info.views, info.lights}) {
    ASSERT_EQ(directions.size(), expected.size());
    for (size_t i = 0; i < expected.size(); ++i) {
      EXPECT_NEAR(directions[i].theta_rad, expected[i].theta_rad, 1e-9);
      EXPECT_NEAR(directions[i].phi_rad, expected[i].phi_rad, 1e-9);
    }
  }
  constexpr int kRows = 8;
  std::vector<float> rows(kRows * (*source)->SamplesPerRow());
  double sum = 0.0;
  for (int y = 0; y < info.height; y += kRows) {
    ASSERT_TRUE((*source)->ReadRows(y, kRows, rows, RunContext{}).ok());
    for (const float value : rows) {
      sum += double{value} * value;
    }
  }
  const auto read = std::chrono::steady_clock::now();
  // design.md, section 3: linear by gamma 2.2, RMS 0.26.
  EXPECT_NEAR(std::sqrt(sum / (rows.size() / kRows * info.height)), 0.26, 0.01);
  const auto seconds = [](auto duration) { return std::chrono::duration<double>(duration).count(); };
  std::printf("import %.2f s, rows %.2f s\n", seconds(imported - begin), seconds(read - imported));
}

struct Ring {
  size_t begin;
  size_t size;
};
// Rings of the UBO2003 set at 45, 60 and 75 degrees.
constexpr Ring kRings[] = {{19, 18}, {37, 20}, {57, 24}};

// Which way azimuths turn is written nowhere in the data, but it shows: the relief's lit sides lie towards
// the light. For every light of a ring, seen from above, the deviation from the ring's mean picture is
// correlated with that mean picture at offsets up to 4 texels; the correlation leans towards the light. Were
// azimuths clockwise, or counted from another axis, the leaning would turn with -phi or be off by a constant.
TEST(WoolTest, LightAzimuthsRunCounterClockwiseFromTheColumns) {
  TESSERA_REQUIRE_DATA(kWool);
  constexpr int kSize = 128;
  constexpr int kReach = 4;
  const auto source =
      ImportBtf(TestData(kWool), {.transfer = Transfer{TransferKind::kGamma, 2.2}}, RunContext{}).value();
  const std::vector<Direction> lights = source->info().lights;
  std::vector<float> row(source->SamplesPerRow());
  std::vector<std::vector<double>> image(81,
                                         std::vector<double>(kSize * kSize));  // [light][texel], from above
  for (int y = 0; y < kSize; ++y) {
    ASSERT_TRUE(source->ReadRows(y, 1, row, RunContext{}).ok());
    for (int x = 0; x < kSize; ++x) {
      for (size_t light = 0; light < 81; ++light) {
        image[light][y * kSize + x] = row[(x * 3 + 1) * 81 * 81 + light];
      }
    }
  }
  for (const Ring& ring : kRings) {
    std::vector<double> mean(kSize * kSize);
    for (size_t i = 0; i < ring.size; ++i) {
      std::vector<double>& picture = image[ring.begin + i];
      double sum = 0.0;
      for (const double value : picture) {
        sum += value;
      }
      for (size_t texel = 0; texel < picture.size(); ++texel) {
        picture[texel] *= picture.size() / sum;
        mean[texel] += picture[texel] / ring.size;
      }
    }
    std::complex<double> same_sense = 0.0;      // mean of exp(i (leaning - phi))
    std::complex<double> opposite_sense = 0.0;  // mean of exp(i (leaning + phi))
    for (size_t i = 0; i < ring.size; ++i) {
      const std::vector<double>& picture = image[ring.begin + i];
      std::complex<double> leaning = 0.0;
      for (int dy = -kReach; dy <= kReach; ++dy) {
        for (int dx = -kReach; dx <= kReach; ++dx) {
          double correlation = 0.0;
          for (int y = kReach; y < kSize - kReach; ++y) {
            for (int x = kReach; x < kSize - kReach; ++x) {
              const int texel = y * kSize + x;
              correlation +=
                  (picture[texel + dy * kSize + dx] - mean[texel + dy * kSize + dx]) * (mean[texel] - 1.0);
            }
          }
          leaning += correlation * std::complex<double>(dx, -dy);  // row 0 is on top: up is -dy
        }
      }
      leaning /= std::abs(leaning);
      const std::complex<double> azimuth = std::polar(1.0, lights[ring.begin + i].phi_rad);
      same_sense += leaning * std::conj(azimuth) / double(ring.size);
      opposite_sense += leaning * azimuth / double(ring.size);
    }
    EXPECT_GT(std::abs(same_sense), 0.75);
    EXPECT_LT(std::abs(opposite_sense), 0.35);
    EXPECT_LT(std::abs(DegFromRad(std::arg(same_sense))), 15.0);
    std::printf("ring %zu: coherence %.2f, offset %.1f degrees, mirrored %.2f\n", ring.size,
                std::abs(same_sense), DegFromRad(std::arg(same_sense)), std::abs(opposite_sense));
  }
}

// Views turn the same way as lights: the mean brightness depends on the difference of their azimuths, hardly
// on the sum.
TEST(WoolTest, ViewAzimuthsTurnLikeThoseOfLights) {
  TESSERA_REQUIRE_DATA(kWool);
  const auto source =
      ImportBtf(TestData(kWool), {.transfer = Transfer{TransferKind::kGamma, 2.2}}, RunContext{}).value();
  std::vector<float> row(source->SamplesPerRow());
  std::vector<double> mean(81 * 81);  // [view][light]
  for (int y = 0; y < 128; y += 4) {
    ASSERT_TRUE(source->ReadRows(y, 1, row, RunContext{}).ok());
    for (size_t i = 0; i < row.size(); ++i) {
      mean[i % mean.size()] += row[i];
    }
  }
  for (const Ring& ring : kRings) {
    std::complex<double> difference = 0.0;
    std::complex<double> sum = 0.0;
    for (size_t view = ring.begin; view < ring.begin + ring.size; ++view) {
      for (size_t light = ring.begin; light < ring.begin + ring.size; ++light) {
        const double view_phi = source->info().views[view].phi_rad;
        const double light_phi = source->info().lights[light].phi_rad;
        difference += std::polar(mean[view * 81 + light], 2.0 * (light_phi - view_phi));
        sum += std::polar(mean[view * 81 + light], 2.0 * (light_phi + view_phi));
      }
    }
    EXPECT_GT(std::abs(difference), 5.0 * std::abs(sum));
  }
}

}  // namespace
}  // namespace tessera
