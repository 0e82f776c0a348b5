#include "btf/tiles/corners.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <vector>

#include <gtest/gtest.h>

#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

constexpr int kStripHeight = 8;

Corners Choose(const Exemplar& exemplar, const char* arrangement, int strip_height, uint64_t seed) {
  const ExemplarSpectra spectra(exemplar, {0, 1, 2, 3}, RegionSide(exemplar, 8), RunContext{});
  absl::StatusOr<std::vector<Corners>> sets =
      ChooseCorners(spectra, **FindArrangement(arrangement), strip_height, seed, RunContext{});
  EXPECT_TRUE(sets.ok()) << sets.status();
  return sets->front();
}

// First and last column and row of a sample in the unturned exemplar.
std::array<int, 4> Rectangle(const Exemplar& exemplar, const Patch& patch, int strip_height) {
  const auto a = static_cast<int>(BtfelOfTexel(exemplar.TexelAt(patch.turn, patch.u, patch.v)));
  const auto b = static_cast<int>(
      BtfelOfTexel(exemplar.TexelAt(patch.turn, patch.u + strip_height / 2 - 1, patch.v + strip_height - 1)));
  const int width = exemplar.width();
  return {std::min(a % width, b % width), std::min(a / width, b / width), std::max(a % width, b % width),
          std::max(a / width, b / width)};
}

// A set cut from one patch has no seams, and every vertex and tile looks alike.
TEST(ChooseCornersTest, TakesEverySampleFromAnotherPlace) {
  const Exemplar exemplar(BumpyEmbedding(80, 72, 1));
  for (const char* const arrangement : {"plane-16", "plane-81", "surface-96"}) {
    for (const uint64_t seed : {1, 2}) {
      const Corners corners = Choose(exemplar, arrangement, kStripHeight, seed);
      for (size_t i = 0; i < corners.samples.size(); ++i) {
        const auto p = Rectangle(exemplar, corners.samples[i], kStripHeight);
        for (size_t j = 0; j < i; ++j) {
          const auto q = Rectangle(exemplar, corners.samples[j], kStripHeight);
          const int twice_distance =
              std::max(std::abs(p[0] + p[2] - q[0] - q[2]), std::abs(p[1] + p[3] - q[1] - q[3]));
          EXPECT_GT(twice_distance, kStripHeight)
              << arrangement << " seed " << seed << ": samples " << j << " and " << i;
        }
      }
    }
  }
}

// What lies beyond a sample counts in its cuts, so a sample at the rim would look cheaper than it is.
TEST(ChooseCornersTest, KeepsSamplesOffTheRim) {
  const Exemplar exemplar(BumpyEmbedding(48, 40, 2));
  for (const char* const arrangement : {"plane-16", "plane-81", "surface-96"}) {
    for (const Patch& sample : Choose(exemplar, arrangement, kStripHeight, 1).samples) {
      const auto [x0, y0, x1, y1] = Rectangle(exemplar, sample, kStripHeight);
      EXPECT_GE(std::min(x0, y0), kStripHeight / 2) << arrangement;
      EXPECT_LE(x1, 47 - kStripHeight / 2) << arrangement;
      EXPECT_LE(y1, 39 - kStripHeight / 2) << arrangement;
    }
  }
}

TEST(ChooseCornersTest, FindsRoomInTheSmallestExemplar) {
  const Exemplar exemplar(BumpyEmbedding(32, 32, 3));
  for (const char* const arrangement : {"plane-16", "plane-81", "surface-96"}) {
    EXPECT_FALSE(Choose(exemplar, arrangement, 16, 1).samples.empty());
  }
}

}  // namespace
}  // namespace tessera
