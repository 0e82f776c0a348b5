#include "btf/remesh/closest_point.h"

#include <limits>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/wang/shapes.h"
#include "tests/btf/remesh/triangles.h"

namespace tessera {
namespace {

// Rounding of points of size 1.
constexpr double kRounding = 1e-12;

TEST(ClosestPointTest, IsOnItsTriangleAndNoSampleOfTheSurfaceIsCloser) {
  const TriangleMesh mesh = Halved(*BuiltinShape("torus"));
  const std::vector<Eigen::Vector3d> positions = DoublesOf(mesh);
  const auto surface = ClosestPoint::Create(positions, mesh.triangles);
  ASSERT_TRUE(surface.ok()) << surface.status();
  Rng rng(7);
  const auto uniform = [&] { return static_cast<double>(rng.NextBelow(1 << 20)) / (1 << 20); };
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d p = 2.0 * Eigen::Vector3d(uniform(), uniform(), uniform()).array() - 1.0;
    const SurfacePoint found = surface->Find(p);
    EXPECT_NEAR((found.position - p).norm(), found.distance, kRounding);
    EXPECT_NEAR(found.barycentric.sum(), 1.0, kRounding);
    EXPECT_GE(found.barycentric.minCoeff(), -kRounding);
    Eigen::Vector3d on_triangle = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      on_triangle += found.barycentric[k] * positions[mesh.triangles[found.triangle][k]];
    }
    EXPECT_LT((on_triangle - found.position).norm(), kRounding);
    constexpr int kSamples = 8;
    for (const Triangle& triangle : mesh.triangles) {
      for (int u = 0; u <= kSamples; ++u) {
        for (int v = 0; u + v <= kSamples; ++v) {
          const Eigen::Vector3d sample = (u * positions[triangle[0]] + v * positions[triangle[1]] +
                                          (kSamples - u - v) * positions[triangle[2]]) /
                                         kSamples;
          ASSERT_GE((sample - p).norm(), found.distance - kRounding);
        }
      }
    }
  }
}

TEST(ClosestPointTest, TiesGoToTheLowestTriangle) {
  const TriangleMesh box = Box({-1.0f, -1.0f, -1.0f}, {1.0f, 1.0f, 1.0f});
  const auto surface = ClosestPoint::Create(DoublesOf(box), box.triangles);
  ASSERT_TRUE(surface.ok());
  EXPECT_EQ(surface->Find({0.0, 0.0, 0.0}).triangle, 0u);
  EXPECT_EQ(surface->Find({0.0, 0.0, 0.0}).distance, 1.0);
}

TEST(ClosestPointTest, FacingPassesOverTheOtherSideOfAThinPart) {
  const TriangleMesh sheet = Box({-1.0f, -1.0f, 0.0f}, {1.0f, 1.0f, 0.1f});
  const auto surface = ClosestPoint::Create(DoublesOf(sheet), sheet.triangles);
  ASSERT_TRUE(surface.ok());
  const Eigen::Vector3d p(0.25, 0.5, 0.02);
  EXPECT_NEAR(surface->Find(p).position.z(), 0.0, kRounding);
  EXPECT_NEAR(surface->FindFacing(p, Eigen::Vector3d::UnitZ()).position.z(), 0.1, 1e-8);
}

TEST(ClosestPointTest, SegmentsAreFlatTriangles) {
  const auto line = ClosestPoint::Create({{0, 0, 0}, {1, 0, 0}}, {{0, 1, 1}});
  ASSERT_TRUE(line.ok());
  EXPECT_LT((line->Find({0.25, 3.0, 4.0}).position - Eigen::Vector3d(0.25, 0, 0)).norm(), kRounding);
  EXPECT_EQ(line->Find({-2.0, 0.0, 0.0}).distance, 2.0);
}

}  // namespace
}  // namespace tessera
