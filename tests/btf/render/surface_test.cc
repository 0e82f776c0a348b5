#include "btf/render/surface.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "btf/wang/dress.h"
#include "btf/wang/quad_mesh.h"
#include "btf/wang/shapes.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using testing::AsSurface96;
using testing::RandomBtfels;
using testing::RandomDressing;
using testing::RandomTileSet;
using testing::SkewedGrid;

constexpr double kRounding = 1e-9;
// Of weights in single precision.
constexpr double kWeightRounding = 1e-6;

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

// Returns how many edges were looked at.
int ExpectSameReflectanceAcrossEdges(const Dressing& dressing, const TileSet& tile_set) {
  const auto surface = DressedSurface::Create(dressing, tile_set);
  const auto decoder = MakeDecoder(tile_set.btfels);
  const auto adjacency = BuildAdjacency(dressing.mesh);
  EXPECT_TRUE(surface.ok() && decoder.ok() && adjacency.ok()) << surface.status() << decoder.status();
  if (!surface.ok() || !decoder.ok() || !adjacency.ok()) {
    return 0;
  }
  const Eigen::Vector3d to_light = Eigen::Vector3d(0.5, -0.3, 0.8).normalized();
  const Eigen::Vector3d eye(0.4, 0.3, 3.0);
  const auto reflectance = [&](const SurfacePoint& point) {
    const SurfaceFrame frame = surface->FrameAt(point);
    return ReflectanceOfTaps({*surface, surface->BilinearTaps(point)}, **decoder, frame, to_light,
                             (eye - frame.position).normalized());
  };
  int edges = 0;
  for (int face = 0; face < static_cast<int>(dressing.mesh.quads.size()); ++face) {
    for (int side = 0; side < 4; ++side) {
      const QuadAdjacency::Across across = adjacency->across[face][side];
      if (across.face <= face) {
        continue;
      }
      ++edges;
      for (int i = 0; i < 16; ++i) {
        // From vertex to vertex: the first and the last points lie within half a texel of them.
        const double along = 0.01 + 0.98 * i / 15.0;
        const Eigen::Array3d here = reflectance(PointOnSide(face, side, along));
        const Eigen::Array3d there = reflectance(PointOnSide(across.face, across.side, 1.0 - along));
        // The other sides' weights on a side are 1e-6 / distance, distance at least 0.01: 1e-4 radians.
        EXPECT_LT((here - there).abs().maxCoeff(), 3e-4)
            << "face " << face << " side " << side << " at " << along;
      }
    }
  }
  return edges;
}

TEST_F(SurfaceTest, BothSidesOfEveryEdgeShowTheSameReflectance) {
  EXPECT_EQ(ExpectSameReflectanceAcrossEdges(dressing_, tile_set_), 2 * kFaces * (kFaces - 1));
}

TEST_F(SurfaceTest, TilesLaidTurnedShowTheSameReflectanceFromBothSides) {
  const TileSet tile_set = RandomTileSet(RandomBtfels(64, 4, 4, 3), 8, 4, "surface-26");
  const auto dressed =
      DressMesh(*BuiltinShape("genus3"), **FindArrangement("surface-26"), {.seed = 2}, RunContext{});
  ASSERT_TRUE(dressed.ok()) << dressed.status();
  EXPECT_EQ(ExpectSameReflectanceAcrossEdges(dressed->dressing, tile_set),
            static_cast<int>(2 * dressed->dressing.mesh.quads.size()));
}

// The turn of a dressing moves texels and turns what they reflect, exactly as turning the tile's own texels
// does.
TEST_F(SurfaceTest, TilesLaidTurnedShowWhatTurnedTilesShow) {
  const TileSet few = RandomTileSet(RandomBtfels(64, 9, 9, 3), 8, 4, "surface-26");
  const TileSet all = AsSurface96(few);
  const QuadMesh mesh = *BuiltinShape("cube-sphere");
  const Dressing turned = DressMesh(mesh, **FindArrangement("surface-26"), {}, RunContext{})->dressing;
  const Dressing unturned = DressMesh(mesh, **FindArrangement("surface-96"), {}, RunContext{})->dressing;
  const auto surface = DressedSurface::Create(turned, few);
  const auto expected = DressedSurface::Create(unturned, all);
  ASSERT_TRUE(surface.ok() && expected.ok()) << surface.status() << expected.status();
  const auto decoder = *MakeDecoder(few.btfels);
  const Eigen::Vector3d to_light = Eigen::Vector3d(0.5, -0.3, 0.8).normalized();
  Rng rng(9);
  for (int face = 0; face < static_cast<int>(mesh.quads.size()); ++face) {
    const SurfacePoint point{face, rng.NextDouble(), rng.NextDouble()};
    const auto reflectance = [&](const DressedSurface& on) {
      const SurfaceFrame frame = on.FrameAt(point);
      return ReflectanceOfTaps({on, on.BilinearTaps(point)}, *decoder, frame, to_light, frame.n);
    };
    EXPECT_LT((reflectance(*surface) - reflectance(*expected)).abs().maxCoeff(), kRounding) << face;
  }
}

TEST_F(SurfaceTest, BothSidesOfEveryEdgeShowTheSameMipLevels) {
  const auto mips = MakeTileMips(tile_set_, {}, {});
  ASSERT_TRUE(mips.ok()) << mips.status();
  const auto surface = DressedSurface::Create(dressing_, tile_set_, &*mips);
  ASSERT_TRUE(surface.ok()) << surface.status();
  ASSERT_EQ(surface->num_mip_levels(), 4);
  const auto decoder = MakeDecoder(tile_set_.btfels);
  const auto adjacency = BuildAdjacency(dressing_.mesh);
  ASSERT_TRUE(decoder.ok() && adjacency.ok());
  const Eigen::Vector3d to_light = Eigen::Vector3d(0.5, -0.3, 0.8).normalized();
  const Eigen::Vector3d to_eye = Eigen::Vector3d(0.4, 0.3, 3.0).normalized();
  for (const double level : {0.4, 1.0, 2.5, 4.0}) {
    for (int face = 0; face < kFaces * kFaces; ++face) {
      for (int side = 0; side < 4; ++side) {
        const QuadAdjacency::Across across = adjacency->across[face][side];
        for (int i = 0; i < 5 && across.face > face; ++i) {
          const double along = 0.03 + 0.94 * i / 4.0;
          const auto reflectance = [&](const SurfacePoint& point) {
            return ReflectanceOfTaps({*surface, surface->MipTaps(point, level)}, **decoder,
                                     surface->FrameAt(point), to_light, to_eye);
          };
          const Eigen::Array3d here = reflectance(PointOnSide(face, side, along));
          const Eigen::Array3d there = reflectance(PointOnSide(across.face, across.side, 1.0 - along));
          EXPECT_LT((here - there).abs().maxCoeff(), 3e-4)
              << "level " << level << " face " << face << " side " << side << " at " << along;
        }
      }
    }
  }
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

TEST_F(SurfaceTest, WeightsOfMipLevelsSumToOneAndNameTheLevelsAround) {
  // A basis that does not turn: up to four parts a texel.
  tile_set_ = RandomTileSet(RandomBtfels(64, 4, 4, 3, testing::BasisKind::kGeneral), 16, 4);
  const auto mips = MakeTileMips(tile_set_, {}, {});
  ASSERT_TRUE(mips.ok()) << mips.status();
  const auto surface = DressedSurface::Create(dressing_, tile_set_, &*mips);
  ASSERT_TRUE(surface.ok());
  for (const double level : {-1.0, 0.0, 0.25, 1.0, 2.75, 4.0, 99.0}) {
    const double clamped = std::clamp(level, 0.0, 4.0);
    double sum = 0.0;
    double mean_level = 0.0;
    for (const Tap& tap : surface->MipTaps({7, 0.3, 0.97}, level)) {
      EXPECT_LE(std::abs(tap.level - clamped), 1.0);
      sum += tap.weight;
      mean_level += tap.weight * tap.level;
    }
    EXPECT_NEAR(sum, 1.0, kWeightRounding);
    EXPECT_NEAR(mean_level, clamped, kWeightRounding);
  }
}

TEST_F(SurfaceTest, TangentsAreTheChangesOfThePosition) {
  const auto surface = DressedSurface::Create(dressing_, tile_set_);
  ASSERT_TRUE(surface.ok());
  const SurfacePoint at{7, 0.3, 0.6};
  const Eigen::Vector3d position = surface->PositionAt(at);
  // Bilinear: differences of any size along s or q are exact.
  EXPECT_LT((surface->TangentsAt(at).col(0) - (surface->PositionAt({7, 0.8, 0.6}) - position) / 0.5).norm(),
            kRounding);
  EXPECT_LT((surface->TangentsAt(at).col(1) - (surface->PositionAt({7, 0.3, 0.1}) - position) / -0.5).norm(),
            kRounding);
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
  auto mips = MakeTileMips(RandomTileSet(RandomBtfels(9, 9, 9, 3), 8, 4), {}, {});
  ASSERT_TRUE(mips.ok());
  EXPECT_EQ(DressedSurface::Create(dressing_, tile_set_, &*mips).status().code(),
            absl::StatusCode::kInvalidArgument);
  mips = MakeTileMips(tile_set_, {}, {});
  ASSERT_TRUE(mips.ok());
  mips->levels[2].parts[5].texel = PackTexel(1U << 20, 0);
  EXPECT_EQ(DressedSurface::Create(dressing_, tile_set_, &*mips).status().code(),
            absl::StatusCode::kInvalidArgument);
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
