#include "btf/render/surface.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "btf/wang/quad_mesh.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using testing::RandomBtfels;
using testing::RandomDressing;
using testing::RandomTileSet;
using testing::SkewedGrid;

constexpr double kRounding = 1e-9;

// The point at `along` of side k, counted from the side's start.
SurfacePoint PointOnSide(int face, int side, double along) {
  switch (side) {
    case 0:
      return {face, along, 0.0};
    case 1:
      return {face, 1.0, along};
    case 2:
      return {face, 1.0 - along, 1.0};
    default:
      return {face, 0.0, 1.0 - along};
  }
}

class SurfaceTest : public ::testing::Test {
 protected:
  static constexpr int kFaces = 5;
  SurfaceTest()
      : tile_set_(RandomTileSet(RandomBtfels(64, 9, 9, 3), 16, 4)),
        dressing_(RandomDressing(SkewedGrid(kFaces, 0.35, 5), 6)) {}
  TileSet tile_set_;
  Dressing dressing_;
};

TEST_F(SurfaceTest, BothSidesOfEveryEdgeShowTheSameReflectance) {
  const auto surface = DressedSurface::Create(dressing_, tile_set_);
  ASSERT_TRUE(surface.ok()) << surface.status();
  const auto decoder = MakeDecoder(tile_set_.btfels);
  ASSERT_TRUE(decoder.ok()) << decoder.status();
  const auto adjacency = BuildAdjacency(dressing_.mesh);
  ASSERT_TRUE(adjacency.ok());
  const Eigen::Vector3d to_light = Eigen::Vector3d(0.5, -0.3, 0.8).normalized();
  const Eigen::Vector3d eye(0.4, 0.3, 3.0);
  int edges = 0;
  for (int face = 0; face < kFaces * kFaces; ++face) {
    for (int side = 0; side < 4; ++side) {
      const QuadAdjacency::Across across = adjacency->across[face][side];
      if (across.face <= face) {
        continue;
      }
      ++edges;
      for (int i = 0; i < 16; ++i) {
        // From vertex to vertex: the first and the last points lie within half a texel of them.
        const double along = 0.01 + 0.98 * i / 15.0;
        const auto reflectance = [&](const SurfacePoint& point) {
          const SurfaceFrame frame = surface->FrameAt(point);
          return ReflectanceOfTaps(*surface, **decoder, frame, surface->BilinearTaps(point), to_light,
                                   (eye - frame.position).normalized());
        };
        const Eigen::Array3d here = reflectance(PointOnSide(face, side, along));
        const Eigen::Array3d there = reflectance(PointOnSide(across.face, across.side, 1.0 - along));
        // The other sides' weights on a side are 1e-6 / distance, distance at least 0.01: 1e-4 radians.
        EXPECT_LT((here - there).abs().maxCoeff(), 3e-4)
            << "face " << face << " side " << side << " at " << along;
      }
    }
  }
  EXPECT_EQ(edges, 2 * kFaces * (kFaces - 1));
}

TEST_F(SurfaceTest, FramesAreOrthonormalAndEqualUpToQuarterTurnsAcrossEdges) {
  const auto surface = DressedSurface::Create(dressing_, tile_set_);
  ASSERT_TRUE(surface.ok());
  const auto adjacency = BuildAdjacency(dressing_.mesh);
  for (int face = 0; face < kFaces * kFaces; ++face) {
    for (int side = 0; side < 4; ++side) {
      const SurfaceFrame frame = surface->FrameAt(PointOnSide(face, side, 0.3));
      EXPECT_NEAR(frame.t.norm(), 1.0, kRounding);
      EXPECT_NEAR(frame.n.norm(), 1.0, kRounding);
      EXPECT_NEAR(frame.t.dot(frame.n), 0.0, kRounding);
      EXPECT_NEAR((frame.t.cross(frame.b) - frame.n).norm(), 0.0, kRounding);
      const QuadAdjacency::Across across = adjacency->across[face][side];
      if (across.face < 0) {
        continue;
      }
      const SurfaceFrame other = surface->FrameAt(PointOnSide(across.face, across.side, 0.7));
      EXPECT_NEAR((frame.position - other.position).norm(), 0.0, kRounding);
      EXPECT_NEAR((frame.n - other.n).norm(), 0.0, kRounding);
      const double along_t = std::abs(frame.t.dot(other.t));
      EXPECT_NEAR(std::min(along_t, std::abs(along_t - 1.0)), 0.0, 1e-4);
    }
  }
}

TEST_F(SurfaceTest, AFlatSquareHasTheFrameOfItsGrid) {
  dressing_ = RandomDressing(SkewedGrid(2, 0.0, 1), 2);
  dressing_.turns = {0, 1, 2, 3};
  const auto surface = DressedSurface::Create(dressing_, tile_set_);
  ASSERT_TRUE(surface.ok());
  const std::array<Eigen::Vector3d, 4> expected = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(),
                                                   -Eigen::Vector3d::UnitX(), -Eigen::Vector3d::UnitY()};
  for (int face = 0; face < 4; ++face) {
    EXPECT_NEAR((surface->FrameAt({face, 0.4, 0.8}).t - expected[face]).norm(), 0.0, kRounding);
  }
}

TEST_F(SurfaceTest, TexelsLieWhereTheTileTurns) {
  dressing_ = RandomDressing(SkewedGrid(2, 0.0, 1), 2);
  const int w = tile_set_.tile_size;
  for (int turns = 0; turns < 4; ++turns) {
    std::fill(dressing_.turns.begin(), dressing_.turns.end(), static_cast<uint8_t>(turns));
    const auto surface = DressedSurface::Create(dressing_, tile_set_);
    ASSERT_TRUE(surface.ok());
    // Near the start of the tile's south side lies its texel (0, w - 1); tile side 0 lies on face side r.
    const SurfacePoint corner = PointOnSide(0, turns, 0.5 / w);
    const SurfacePoint centre{0, 0.5, 0.5};
    const SurfacePoint inside{0, corner.s + 0.02 * (centre.s - corner.s),
                              corner.q + 0.02 * (centre.q - corner.q)};
    const uint32_t expected = tile_set_.texel(static_cast<int>(dressing_.tile[0]), 0, w - 1);
    const Tap tap = surface->NearestTap(inside);
    EXPECT_EQ(tap.btfel, BtfelOfTexel(expected)) << turns;
    EXPECT_EQ(tap.turns, TurnsOfTexel(expected)) << turns;
  }
}

TEST_F(SurfaceTest, WeightsSumToOneEverywhere) {
  const auto surface = DressedSurface::Create(dressing_, tile_set_);
  ASSERT_TRUE(surface.ok());
  for (int i = 0; i <= 64; ++i) {
    for (int j = 0; j <= 64; ++j) {
      double sum = 0.0;
      for (const Tap& tap : surface->BilinearTaps({7, i / 64.0, j / 64.0})) {
        EXPECT_GE(tap.weight, 0.0);
        sum += tap.weight;
      }
      EXPECT_NEAR(sum, 1.0, kRounding);
    }
  }
}

TEST_F(SurfaceTest, RefusesWhatDoesNotFit) {
  Dressing other = dressing_;
  other.arrangement_sha256 = "0";
  EXPECT_EQ(DressedSurface::Create(other, tile_set_).status().code(), absl::StatusCode::kFailedPrecondition);
  other = dressing_;
  other.mesh.positions[3].x() = std::nanf("");
  EXPECT_EQ(DressedSurface::Create(other, tile_set_).status().code(), absl::StatusCode::kInvalidArgument);
  other = dressing_;
  other.mesh.quads[1][2] = 10000;
  EXPECT_EQ(DressedSurface::Create(other, tile_set_).status().code(), absl::StatusCode::kInvalidArgument);
  TileSet tile_set = tile_set_;
  tile_set.tile_index[99] = PackTexel(64, 1);
  EXPECT_EQ(DressedSurface::Create(dressing_, tile_set).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(SurfaceTest, DegenerateQuadsHaveFiniteFrames) {
  for (Eigen::Vector3f& position : dressing_.mesh.positions) {
    position.setZero();
  }
  for (Eigen::Vector3f& normal : dressing_.mesh.normals) {
    normal.setZero();
  }
  const auto surface = DressedSurface::Create(dressing_, tile_set_);
  ASSERT_TRUE(surface.ok());
  EXPECT_TRUE(surface->FrameAt({0, 0.0, 1.0}).t.allFinite());
}

}  // namespace
}  // namespace tessera
