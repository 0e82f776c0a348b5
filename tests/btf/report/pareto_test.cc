#include "btf/report/pareto.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/rng.h"

namespace tessera {
namespace {

using ::testing::ElementsAre;

TEST(ParetoTest, BeatenTiedAndNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<TwoCosts> points = {{1, 5}, {2, 5},   {2, 3},   {2, 3}, {3, 4},
                                        {4, 1}, {0, nan}, {nan, 0}, {5, 1}};
  EXPECT_THAT(ParetoFront(points), ElementsAre(true, false, true, true, false, true, false, false, false));
  EXPECT_TRUE(ParetoFront({}).empty());
}

TEST(ParetoTest, AgreesWithTheDefinition) {
  Rng rng(5);
  std::vector<TwoCosts> points;
  for (int i = 0; i < 200; ++i) {
    // Few values, so that ties are common.
    points.push_back({static_cast<double>(rng.NextBelow(15)), static_cast<double>(rng.NextBelow(15))});
  }
  const std::vector<bool> front = ParetoFront(points);
  for (size_t i = 0; i < points.size(); ++i) {
    bool is_beaten = false;
    for (const TwoCosts& other : points) {
      is_beaten |= other.x <= points[i].x && other.y <= points[i].y &&
                   (other.x < points[i].x || other.y < points[i].y);
    }
    EXPECT_EQ(front[i], !is_beaten) << i;
  }
}

}  // namespace
}  // namespace tessera
