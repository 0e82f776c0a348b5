#include "btf/light/texel_grid.h"

#include <cmath>

#include <gtest/gtest.h>

#include "btf/math/conventions.h"
#include "tests/btf/light/random_rotation.h"

namespace tessera {
namespace {

using ::tessera::TexelGrid;

TexelGrid Angular(int width) {
  return {EnvironmentLayout::kAngular, width, width};
}

double TotalSolidAngle(const TexelGrid& grid) {
  double sum = 0.0;
  for (int y = 0; y < grid.height(); ++y) {
    for (int x = 0; x < grid.width(); ++x) {
      sum += grid.SolidAngle(x, y);
    }
  }
  return sum;
}

TEST(TexelGridTest, SolidAnglesAddUpToTheSphere) {
  for (const int width : {1, 2, 3, 4, 7, 32, 63, 64, 65, 200}) {
    EXPECT_NEAR(TotalSolidAngle(Angular(width)), 4.0 * kPi, 1e-11) << width;
    EXPECT_NEAR(TotalSolidAngle({EnvironmentLayout::kEquirect, 2 * width, width}), 4.0 * kPi, 1e-11) << width;
  }
  EXPECT_NEAR(TotalSolidAngle({EnvironmentLayout::kEquirect, 5, 17}), 4.0 * kPi, 1e-12);
}

TEST(TexelGridTest, EquirectSolidAnglesAreThoseOfZones) {
  const TexelGrid grid(EnvironmentLayout::kEquirect, 6, 4);
  EXPECT_NEAR(grid.SolidAngle(3, 0), 2.0 * kPi / 6 * (1.0 - std::sin(kPi / 4)), 1e-15);
  EXPECT_NEAR(grid.SolidAngle(5, 2), 2.0 * kPi / 6 * std::sin(kPi / 4), 1e-15);
}

TEST(TexelGridTest, AngularSolidAnglesAreIntegralsOfTheDensity) {
  // The midpoint rule, cut off at the rim: 1e-4 of a texel there.
  constexpr int kSteps = 400;
  for (const int width : {5, 12, 70}) {
    const TexelGrid grid = Angular(width);
    for (int y = 0; y < width; y += width / 5) {
      for (int x = 0; x < width; x += width / 5) {
        double sum = 0.0;
        for (int i = 0; i < kSteps * kSteps; ++i) {
          const double u = 2.0 * (x + (i % kSteps + 0.5) / kSteps) / width - 1.0;
          const double v = 2.0 * (y + (i / kSteps + 0.5) / kSteps) / width - 1.0;
          const double r = std::hypot(u, v);
          sum += r >= 1.0 ? 0.0 : r == 0.0 ? kPi * kPi : kPi * std::sin(kPi * r) / r;
        }
        sum *= 4.0 / (static_cast<double>(width) * width * kSteps * kSteps);
        EXPECT_NEAR(grid.SolidAngle(x, y), sum, 4e-5 * kPi * kPi / (width * width))
            << width << ' ' << x << ' ' << y;
      }
    }
  }
  EXPECT_EQ(Angular(12).SolidAngle(0, 0), 0.0);
  EXPECT_EQ(Angular(12).SolidAngle(11, 0), 0.0);
}

TEST(TexelGridTest, WhichTexelLooksWhere) {
  const TexelGrid equirect(EnvironmentLayout::kEquirect, 800, 401);
  const auto near = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return (a - b).norm() < 0.01; };
  EXPECT_TRUE(near(equirect.Direction(400, 200), {0, 0, -1}));
  EXPECT_TRUE(near(equirect.Direction(600, 200), {1, 0, 0}));
  EXPECT_TRUE(near(equirect.Direction(200, 200), {-1, 0, 0}));
  EXPECT_TRUE(near(equirect.Direction(0, 200), {0, 0, 1}));
  EXPECT_TRUE(near(equirect.Direction(799, 200), {0, 0, 1}));
  EXPECT_TRUE(near(equirect.Direction(123, 0), {0, 1, 0}));
  EXPECT_TRUE(near(equirect.Direction(123, 400), {0, -1, 0}));
  const TexelGrid angular = Angular(801);
  EXPECT_TRUE(near(angular.Direction(400, 400), {0, 0, -1}));
  EXPECT_TRUE(near(angular.Direction(600, 400), {1, 0, 0}));
  EXPECT_TRUE(near(angular.Direction(400, 200), {0, 1, 0}));
  EXPECT_TRUE(near(angular.Direction(400, 600), {0, -1, 0}));
  EXPECT_TRUE(near(angular.Direction(0, 400), {0, 0, 1}));
  EXPECT_TRUE(near(angular.Direction(400, 800), {0, 0, 1}));
}

TEST(TexelGridTest, PicturesAreNotMirrored) {
  // Seen from inside: right, up and back at the picture's centre are right-handed.
  for (const TexelGrid& grid : {TexelGrid(EnvironmentLayout::kEquirect, 40, 20), Angular(40)}) {
    for (const int x : {13, 20, 27}) {
      const int y = grid.height() / 2;
      const Eigen::Vector3d forward = grid.Direction(x, y);
      const Eigen::Vector3d right = grid.Direction(x + 1, y) - grid.Direction(x - 1, y);
      const Eigen::Vector3d up = grid.Direction(x, y - 1) - grid.Direction(x, y + 1);
      EXPECT_LT(right.cross(up).dot(forward), 0.0);
    }
  }
}

TEST(TexelGridTest, PlaceIsTheInverseOfDirection) {
  for (const TexelGrid& grid : {TexelGrid(EnvironmentLayout::kEquirect, 34, 17), Angular(33)}) {
    for (int y = 0; y < grid.height(); ++y) {
      for (int x = 0; x < grid.width(); ++x) {
        const Eigen::Vector3d direction = grid.Direction(x, y);
        EXPECT_NEAR(direction.norm(), 1.0, 1e-15);
        if (std::hypot(x - 16.0, y - 16.0) < 16.0 || grid.layout() == EnvironmentLayout::kEquirect) {
          EXPECT_LT((grid.Place(direction) - Eigen::Vector2d(x + 0.5, y + 0.5)).norm(), 1e-11)
              << x << ' ' << y;
        }
      }
    }
    Rng rng(1);
    for (int i = 0; i < 1000; ++i) {
      const Eigen::Vector2d place = grid.Place(RandomDirection(rng));
      EXPECT_TRUE(place.minCoeff() >= 0.0 && place.x() <= grid.width() && place.y() <= grid.height());
    }
  }
  EXPECT_EQ(Angular(10).Place({0, 0, 1}), Eigen::Vector2d(10.0, 5.0));
}

TEST(TexelGridTest, SolidAnglesGoWithDirections) {
  // The area that neighbours' directions span, of texels small enough to be flat.
  for (const TexelGrid& grid : {TexelGrid(EnvironmentLayout::kEquirect, 400, 200), Angular(300)}) {
    for (const int y : {60, 100, 131}) {
      for (const int x : {90, 150, 210}) {
        const Eigen::Vector3d across = grid.Direction(x + 1, y) - grid.Direction(x - 1, y);
        const Eigen::Vector3d down = grid.Direction(x, y + 1) - grid.Direction(x, y - 1);
        EXPECT_NEAR(across.cross(down).norm() / 4.0 / grid.SolidAngle(x, y), 1.0, 1e-3) << x << ' ' << y;
      }
    }
  }
}

}  // namespace
}  // namespace tessera
