#include "btf/math/hemisphere_triangulation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "btf/base/rng.h"

namespace tessera {
namespace {

std::vector<Direction> Rings(const std::vector<std::pair<double, int>>& rings) {
  std::vector<Direction> directions;
  for (const auto& [theta_deg, count] : rings) {
    for (int i = 0; i < count; ++i) {
      directions.push_back({RadFromDeg(theta_deg), 2.0 * kPi * i / count});
    }
  }
  return directions;
}

// The layout of UBO2003.
std::vector<Direction> Measured() {
  return Rings({{0.0, 1}, {15.0, 6}, {30.0, 12}, {45.0, 18}, {60.0, 20}, {75.0, 24}});
}

std::vector<Direction> ScatteredDirections(int count, uint64_t seed, double max_theta_deg = 80.0) {
  Rng rng(seed);
  std::vector<Direction> directions;
  for (int i = 0; i < count; ++i) {
    directions.push_back({RadFromDeg(max_theta_deg) * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()});
  }
  return directions;
}

Eigen::Vector2d Point(const Direction& direction) {
  return StereographicPoint(VectorFromDirection(direction));
}

double Area(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

double TotalArea(const std::vector<Direction>& directions, const std::vector<DirectionTriangle>& triangles) {
  double sum = 0.0;
  for (const auto& [a, b, c] : triangles) {
    const double area = Area(Point(directions[a]), Point(directions[b]), Point(directions[c]));
    EXPECT_GT(area, -1e-7);  // decided on a grid of 2^-24
    sum += area;
  }
  return sum;
}

// Twice the area of the convex hull, by the directions of all supporting lines.
double HullArea(const std::vector<Direction>& directions) {
  std::vector<Eigen::Vector2d> points;
  for (const Direction& direction : directions) {
    points.push_back(Point(direction));
  }
  std::ranges::sort(
      points, [](const auto& a, const auto& b) { return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y()); });
  std::vector<Eigen::Vector2d> hull;
  for (int side = 0; side < 2; ++side) {
    const size_t start = hull.size();
    for (const Eigen::Vector2d& p : points) {
      while (hull.size() >= start + 2 && Area(hull[hull.size() - 2], hull.back(), p) <= 0.0) {
        hull.pop_back();
      }
      hull.push_back(p);
    }
    hull.pop_back();
    std::ranges::reverse(points);
  }
  double area = 0.0;
  for (size_t i = 0; i < hull.size(); ++i) {
    area += Area(Eigen::Vector2d::Zero(), hull[i], hull[(i + 1) % hull.size()]);
  }
  return area;
}

BarycentricWeights Locate(const std::vector<Direction>& directions, const Eigen::Vector3d& at) {
  return HemisphereInterpolator(directions, TriangulateHemisphere(directions)).Locate(at);
}

TEST(HemisphereTriangulationTest, CoversTheHullWithDelaunayTriangles) {
  std::vector<std::vector<Direction>> sets = {Measured(),
                                              ScatteredDirections(60, 1),
                                              ScatteredDirections(200, 2),
                                              Rings({{0.0, 1}, {40.0, 5}}),
                                              Rings({{30.0, 8}, {60.0, 8}}),
                                              Rings({{0.0, 1}, {37.5, 6}, {75.0, 6}})};
  for (size_t i = 0; i < 6; ++i) {  // the same as a file holds them
    sets.push_back(sets[i]);
    for (Direction& d : sets.back()) {
      d = DirectionFromVector(VectorFromDirection(d).cast<float>().cast<double>());
    }
  }
  for (const auto& directions : sets) {
    const auto triangles = TriangulateHemisphere(directions);
    EXPECT_NEAR(TotalArea(directions, triangles), HullArea(directions), 1e-6);
    std::set<int> used;
    for (const auto& [a, b, c] : triangles) {
      used.insert({a, b, c});
      // No other direction inside the circle through the three on the sphere: beyond their plane.
      const Eigen::Vector3d p = VectorFromDirection(directions[a]);
      const Eigen::Vector3d normal =
          (VectorFromDirection(directions[b]) - p).cross(VectorFromDirection(directions[c]) - p).normalized();
      for (const Direction& other : directions) {
        EXPECT_LT(normal.dot(VectorFromDirection(other) - p), 1e-6);
      }
    }
    EXPECT_EQ(used.size(), directions.size());
  }
}

TEST(HemisphereTriangulationTest, WeightsAreBarycentric) {
  const std::vector<Direction> directions = Measured();
  const auto triangles = TriangulateHemisphere(directions);
  const HemisphereInterpolator interpolator(directions, triangles);
  Rng rng(5);
  for (int n = 0; n < 3000; ++n) {
    const Direction at{RadFromDeg(74.0) * std::sqrt(rng.NextDouble()), 2.0 * kPi * rng.NextDouble()};
    const BarycentricWeights w = interpolator.Locate(VectorFromDirection(at));
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    double sum = 0.0;
    for (int s = 0; s < 3; ++s) {
      EXPECT_GE(w.weight[s], 0.0);
      sum += w.weight[s];
      mean += w.weight[s] * Point(directions[w.index[s]]);
    }
    EXPECT_NEAR(sum, 1.0, 1e-12);
    // Inside the triangles the weights give the point back; the chords of the outer ring cut it by 0.9%.
    EXPECT_LT((mean - Point(at)).norm(), 0.01);
    if (at.theta_rad < RadFromDeg(70.0)) {
      EXPECT_LT((mean - Point(at)).norm(), 1e-12);
    }
  }
}

// Every triangle, one by one.
double NearestByForce(const std::vector<Direction>& directions,
                      const std::vector<DirectionTriangle>& triangles, const Eigen::Vector2d& p) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const DirectionTriangle& index : triangles) {
    const Eigen::Vector2d corner[3] = {Point(directions[index[0]]), Point(directions[index[1]]),
                                       Point(directions[index[2]])};
    bool is_inside = true;
    for (int s = 0; s < 3; ++s) {
      const Eigen::Vector2d a = corner[s];
      const Eigen::Vector2d edge = corner[(s + 1) % 3] - a;
      is_inside = is_inside && Area(a, a + edge, p) > 0.0;
      const double t = edge.norm() > 0.0 ? std::clamp(edge.dot(p - a) / edge.squaredNorm(), 0.0, 1.0) : 0.0;
      nearest = std::min(nearest, (a + t * edge - p).norm());
    }
    nearest = is_inside ? 0.0 : nearest;
  }
  return nearest;
}

TEST(HemisphereTriangulationTest, MovesToTheNearestPointOfTheTriangles) {
  const std::vector<std::vector<Direction>> sets = {
      Measured(),
      ScatteredDirections(12, 3, 40.0),
      Rings({{50.0, 3}}),
      {{0.3, 0.2}, {0.8, 0.5}},                                // two
      {{0.9, 1.0}, {0.0, 0.0}, {0.5, 1.0 + kPi}, {0.4, 1.0}},  // on one line
      {{0.7, 2.0}},                                            // one
      {{0.7, 0.1}, {0.9, 0.3}, {0.6, 0.5}, {1.0, 0.6}}};       // all on one side
  for (const auto& directions : sets) {
    const auto triangles = TriangulateHemisphere(directions);
    const HemisphereInterpolator interpolator(directions, triangles);
    double limit = 0.0;
    for (const Direction& d : directions) {
      limit = std::max(limit, d.theta_rad);
    }
    Rng rng(6);
    for (int n = 0; n < 500; ++n) {
      Direction at{RadFromDeg(89.9) * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()};
      const BarycentricWeights w = interpolator.Locate(VectorFromDirection(at));
      at.theta_rad = std::min(at.theta_rad, limit);
      Eigen::Vector2d mean = Eigen::Vector2d::Zero();
      for (int s = 0; s < 3; ++s) {
        ASSERT_GE(w.weight[s], 0.0);
        mean += w.weight[s] * Point(directions[w.index[s]]);
      }
      ASSERT_NEAR((mean - Point(at)).norm(), NearestByForce(directions, triangles, Point(at)), 1e-9);
    }
  }
}

TEST(HemisphereTriangulationTest, SampledDirectionsGetTheirOwnSample) {
  const std::vector<Direction> directions = Measured();
  const HemisphereInterpolator interpolator(directions, TriangulateHemisphere(directions));
  for (size_t i = 0; i < directions.size(); ++i) {
    const BarycentricWeights w = interpolator.Locate(VectorFromDirection(directions[i]));
    double own = 0.0;
    for (int s = 0; s < 3; ++s) {
      own += w.index[s] == static_cast<int>(i) ? w.weight[s] : 0.0;
    }
    EXPECT_NEAR(own, 1.0, 1e-12) << i;
  }
}

TEST(HemisphereTriangulationTest, IsContinuous) {
  const std::vector<Direction> directions = Measured();
  const HemisphereInterpolator interpolator(directions, TriangulateHemisphere(directions));
  Rng rng(8);
  std::vector<double> values;
  for (size_t i = 0; i < directions.size(); ++i) {
    values.push_back(rng.NextDouble());
  }
  const auto value = [&](const Direction& at) {
    const BarycentricWeights w = interpolator.Locate(VectorFromDirection(at));
    return w.weight[0] * values[w.index[0]] + w.weight[1] * values[w.index[1]] +
           w.weight[2] * values[w.index[2]];
  };
  // Small steps along great and small circles, through edges, corners, the outer ring and beyond it: the
  // value moves no faster than 1 over the shortest edge's length (about 0.1 in the chart, here with a
  // margin).
  constexpr double kStep = 1e-4;
  for (int path = 0; path < 40; ++path) {
    const double fixed = path % 2 == 0 ? 2.0 * kPi * path / 40.0 : RadFromDeg(2.2 * path);
    double before = 0.0;
    for (double along = 0.0; along < RadFromDeg(89.9); along += kStep) {
      const double now =
          path % 2 == 0 ? value({along, fixed}) : value({std::min(fixed, RadFromDeg(89.0)), 4.0 * along});
      if (along > 0.0) {
        ASSERT_LT(std::abs(now - before), 60.0 * kStep) << "path " << path << " at " << along;
      }
      before = now;
    }
  }
}

TEST(HemisphereTriangulationTest, DegenerateSets) {
  EXPECT_EQ(TriangulateHemisphere(std::vector<Direction>{{0.4, 1.0}}),
            (std::vector<DirectionTriangle>{{0, 0, 0}}));
  EXPECT_EQ(TriangulateHemisphere(std::vector<Direction>{{0.4, 1.0}, {0.4, 1.0}}),
            (std::vector<DirectionTriangle>{{0, 0, 0}}));
  EXPECT_EQ(TriangulateHemisphere(std::vector<Direction>{{0.4, 1.0}, {0.4, 2.0}}).size(), 1U);
  // The pole, given at six azimuths, and a ring: only the first pole is used.
  std::vector<Direction> directions;
  for (int i = 0; i < 6; ++i) {
    directions.push_back({0.0, kPi / 3.0 * i});
  }
  const std::vector<Direction> ring = Rings({{60.0, 12}});
  directions.insert(directions.end(), ring.begin(), ring.end());
  const auto triangles = TriangulateHemisphere(directions);
  EXPECT_EQ(triangles.size(), 12U);
  EXPECT_NEAR(TotalArea(directions, triangles), HullArea(directions), 1e-6);
  for (const DirectionTriangle& triangle : triangles) {
    for (const int corner : triangle) {
      EXPECT_TRUE(corner == 0 || corner >= 6);
    }
  }
  // Lines through the pole in every direction, in any order.
  for (double azimuth = 0.0; azimuth < kPi; azimuth += kPi / 12.0) {
    const auto line = TriangulateHemisphere(std::vector<Direction>{
        {0.5, azimuth}, {0.9, azimuth + kPi}, {0.0, 0.0}, {1.2, azimuth}, {0.2, azimuth + kPi}});
    EXPECT_EQ(line.size(), 4U);
    for (const auto& [a, b, c] : line) {
      EXPECT_EQ(b, c);
    }
  }
}

TEST(HemisphereTriangulationTest, AMissingPoleIsBridged) {
  const std::vector<Direction> directions = Rings({{45.0, 4}, {75.0, 8}});
  const BarycentricWeights w = Locate(directions, Eigen::Vector3d::UnitZ());
  double sum = 0.0;
  for (int s = 0; s < 3; ++s) {
    if (w.weight[s] > 1e-12) {
      EXPECT_LT(w.index[s], 4);  // of the inner ring
    }
    sum += w.weight[s];
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
}

TEST(HemisphereTriangulationTest, HostileTrianglesStayFinite) {
  const std::vector<Direction> directions = ScatteredDirections(20, 9);
  Rng rng(10);
  std::vector<DirectionTriangle> triangles;
  for (int i = 0; i < 40; ++i) {
    triangles.push_back({static_cast<int>(rng.NextBelow(20)), static_cast<int>(rng.NextBelow(20)),
                         static_cast<int>(rng.NextBelow(20))});
  }
  const HemisphereInterpolator interpolator(directions, triangles);
  for (const Direction& at : ScatteredDirections(500, 11, 89.9)) {
    const BarycentricWeights w = interpolator.Locate(VectorFromDirection(at));
    EXPECT_NEAR(w.weight[0] + w.weight[1] + w.weight[2], 1.0, 1e-9);
    for (int s = 0; s < 3; ++s) {
      EXPECT_GE(w.weight[s], 0.0);
      EXPECT_TRUE(w.index[s] >= 0 && w.index[s] < 20);
    }
  }
}

}  // namespace
}  // namespace tessera
