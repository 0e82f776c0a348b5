#include "btf/meso/height_field_scene.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "btf/base/rng.h"
#include "btf/meso/facets.h"
#include "tests/btf/meso/reference_tracer.h"
#include "tests/btf/meso/small_fields.h"

namespace tessera {
namespace {

// Rays from anywhere over several periods, at elevations down to half a degree, against the cell walker.
TEST(HeightFieldSceneTest, FollowsRaysThroughManyPeriodsAsTheReference) {
  constexpr int kPackets = 1500;
  constexpr double kPointError = 2e-3;            // texels; float after up to hundreds of texels
  constexpr double kShareNearSilhouette = 0.002;  // rays within rounding of an edge may fall on either side
  for (const int cells_per_texel : {1, 3}) {
    const SurfaceMaps maps = HillyField(9, cells_per_texel, 4.0F, 1.0F, 0.0F);
    const auto scene = HeightFieldScene::Create(maps);
    ASSERT_TRUE(scene.ok()) << scene.status();
    const ReferenceTracer reference(maps);
    Rng rng(5);
    int differ = 0;
    int wrapped = 0;
    for (int packet = 0; packet < kPackets; ++packet) {
      RayPacket rays;
      std::array<Eigen::Vector3d, kPacketSize> origins;
      std::array<Eigen::Vector3d, kPacketSize> directions;
      for (int lane = 0; lane < kPacketSize; ++lane) {
        const bool down = lane % 2 == 0;
        const double polar_deg = 20.0 + 69.5 * rng.NextDouble();
        const Eigen::Vector3d d = VectorFromDirection(DirectionFromDeg(polar_deg, 360.0 * rng.NextDouble()));
        directions[lane] = (down ? Eigen::Vector3d(-d) : d).cast<float>().cast<double>();
        origins[lane] = Eigen::Vector3d(9.0 * rng.NextDouble(), 9.0 * rng.NextDouble(),
                                        down ? scene.value()->highest() + 0.01 : 0.0);
        if (!down) {  // start just above the surface
          const ReferenceHit below =
              reference.Trace(origins[lane] + Eigen::Vector3d(0, 0, 10), Eigen::Vector3d(0, 0, -1));
          origins[lane].z() = below.point.z() + 0.02;
        }
        origins[lane] = origins[lane].cast<float>().cast<double>();
        rays.x[lane] = static_cast<float>(origins[lane].x());
        rays.y[lane] = static_cast<float>(origins[lane].y());
        rays.z[lane] = static_cast<float>(origins[lane].z());
        rays.dx[lane] = static_cast<float>(directions[lane].x());
        rays.dy[lane] = static_cast<float>(directions[lane].y());
        rays.dz[lane] = static_cast<float>(directions[lane].z());
        rays.active[lane] = true;
      }
      HitPacket hits;
      scene.value()->Intersect(rays, RayKind::kScattered, hits);
      const auto occluded = scene.value()->Occluded(rays, RayKind::kCoherent);
      for (int lane = 0; lane < kPacketSize; ++lane) {
        const ReferenceHit expected = reference.Trace(origins[lane], directions[lane]);
        EXPECT_EQ(hits.facet[lane] >= 0, occluded[lane]);
        if (expected.found != (hits.facet[lane] >= 0)) {
          ++differ;
          continue;
        }
        if (!expected.found) {
          continue;
        }
        const Eigen::Vector3d start = origins[lane];
        wrapped += std::hypot(expected.point.x() - start.x(), expected.point.y() - start.y()) > 9.0 ? 1 : 0;
        const int64_t facet = hits.facet[lane];
        const int n = maps.resolution();
        const auto p = CornerPositions(maps, static_cast<int>(facet / 2 % n), static_cast<int>(facet / 2 / n),
                                       static_cast<int>(facet % 2));
        const Eigen::Vector3f point =
            (1.0F - hits.u[lane] - hits.v[lane]) * p[0] + hits.u[lane] * p[1] + hits.v[lane] * p[2];
        Eigen::Vector3d error = point.cast<double>() - expected.point;
        error.x() -= 9.0 * std::round(error.x() / 9.0);
        error.y() -= 9.0 * std::round(error.y() / 9.0);
        differ += error.norm() > kPointError ? 1 : 0;
      }
    }
    EXPECT_LE(differ, kShareNearSilhouette * kPackets * kPacketSize);
    EXPECT_GT(wrapped, 100) << "the rays must cross periods for this test to mean anything";
  }
}

TEST(HeightFieldSceneTest, LeavesInactiveLanesAlone) {
  const SurfaceMaps maps = FlatField(4, 1.0F, 1.0F, 0.0F);
  const auto scene = HeightFieldScene::Create(maps);
  ASSERT_TRUE(scene.ok()) << scene.status();
  RayPacket rays;
  rays.z.fill(1.0F);
  rays.dz.fill(-1.0F);
  rays.active[3] = true;
  HitPacket hits;
  scene.value()->Intersect(rays, RayKind::kCoherent, hits);
  for (int lane = 0; lane < kPacketSize; ++lane) {
    EXPECT_EQ(hits.facet[lane] >= 0, lane == 3);
  }
}

TEST(FacetPartsTest, EveryCentroidLiesInItsOwnPartAndPartsAreEqualInArea) {
  for (int edge_parts = 1; edge_parts <= 6; ++edge_parts) {
    const FacetParts parts(edge_parts);
    EXPECT_EQ(parts.count(), edge_parts * edge_parts);
    std::vector<int> hits(parts.count());
    for (int part = 0; part < parts.count(); ++part) {
      EXPECT_EQ(parts.PartAt(parts.centroid(part)[0], parts.centroid(part)[1]), part);
    }
    constexpr int kGrid = 240;
    for (int a = 0; a < kGrid; ++a) {
      for (int b = 0; a + b < kGrid; ++b) {
        const float u = (static_cast<float>(a) + 0.3F) / kGrid;
        const float v = (static_cast<float>(b) + 0.3F) / kGrid;
        ++hits[parts.PartAt(u, v)];
      }
    }
    const auto [least, most] = std::minmax_element(hits.begin(), hits.end());
    EXPECT_LT(*most - *least, 0.15 * *most);
    // Rounding may put a hit outside; it must still name a part.
    for (const auto& [u, v] : {std::array{1.0F, 0.0F}, std::array{0.0F, 1.0F}, std::array{0.6F, 0.4000001F},
                               std::array{-1e-6F, 0.5F}, std::array{1.0F, 1e-6F}}) {
      EXPECT_LT(parts.PartAt(u, v), parts.count());
    }
  }
}

}  // namespace
}  // namespace tessera
