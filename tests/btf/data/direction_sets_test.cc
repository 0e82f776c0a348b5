#include "btf/data/direction_sets.h"

#include <set>

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(DirectionSetsTest, Ubo81HasTheMeasuredRings) {
  const std::vector<Direction> set = DirectionSet("ubo81").value();
  ASSERT_EQ(set.size(), 81u);
  EXPECT_EQ(set[0].theta_rad, 0.0);
  EXPECT_NEAR(DegFromRad(set[1].theta_rad), 15.0, 1e-12);
  EXPECT_NEAR(DegFromRad(set[2].phi_rad), 60.0, 1e-12);
  EXPECT_NEAR(DegFromRad(set[80].theta_rad), 75.0, 1e-12);
  EXPECT_NEAR(DegFromRad(set[80].phi_rad), 345.0, 1e-12);
}

TEST(DirectionSetsTest, SetsAreSortedDistinctAndAboveTheSurface) {
  for (const char* name : {"ubo81", "curet", "1x1", "8x16", "3x5"}) {
    const std::vector<Direction> set = DirectionSet(name).value();
    for (size_t i = 0; i < set.size(); ++i) {
      EXPECT_GE(set[i].theta_rad, 0.0);
      EXPECT_LT(set[i].theta_rad, kPi / 2);
      EXPECT_GE(set[i].phi_rad, 0.0);
      EXPECT_LT(set[i].phi_rad, 2 * kPi);
      EXPECT_TRUE(i == 0 || set[i - 1].theta_rad < set[i].theta_rad ||
                  (set[i - 1].theta_rad == set[i].theta_rad && set[i - 1].phi_rad < set[i].phi_rad))
          << name << " " << i;
    }
  }
  EXPECT_EQ(DirectionSet("curet")->size(), 50u);
  EXPECT_EQ(DirectionSet("3x5")->size(), 15u);
  EXPECT_NEAR(DegFromRad(DirectionSet("3x5")->front().theta_rad), 15.0, 1e-12);
}

TEST(DirectionSetsTest, OthersAreRefused) {
  for (const char* name :
       {"", "ubo", "x", "3x", "x5", "0x5", "3x0", "-1x5", "91x1", "1x361", "64x64", "3x5x2", "3 x5"}) {
    EXPECT_EQ(DirectionSet(name).status().code(), absl::StatusCode::kInvalidArgument) << name;
  }
}

}  // namespace
}  // namespace tessera
