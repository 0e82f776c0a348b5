#include "btf/remesh/voxel_surface.h"

#include <numeric>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/wang/mesh_topology.h"
#include "btf/wang/shapes.h"
#include "tests/btf/remesh/triangles.h"

namespace tessera {
namespace {

constexpr size_t kAllComponents = 1000;

VoxelGrid EmptyGrid(int side) {
  VoxelGrid grid;
  grid.size.setConstant(side);
  grid.cell = 1.0;
  grid.coverage.assign(static_cast<size_t>(side) * side * side, 0.0f);
  grid.filled.assign(grid.coverage.size(), 0);
  return grid;
}

void Fill(VoxelGrid& grid, int x, int y, int z) {
  grid.filled[grid.Index(x, y, z)] = 1;
  grid.coverage[grid.Index(x, y, z)] = 1.0f;
}

// Two faces along every edge, one fan of faces around every vertex.
bool IsManifold(const VoxelSurface& surface) {
  QuadMesh mesh{.quads = surface.quads};
  for (const Eigen::Vector3d& p : surface.positions) {
    mesh.positions.emplace_back(p.cast<float>());
  }
  mesh.normals.assign(mesh.positions.size(), Eigen::Vector3f::UnitZ());
  const auto adjacency = BuildAdjacency(mesh);
  if (!adjacency.ok() || SplitSingularVertices(mesh, *adjacency) > 0) {
    return false;
  }
  const MeshInfo info = *DescribeMesh(mesh);
  return info.num_boundary_edges == 0 && info.num_components == surface.topology.num_components &&
         static_cast<int64_t>(info.genus) == surface.topology.genus;
}

TEST(MakeManifoldTest, DiagonalTouchesBecomeManifold) {
  for (const Eigen::Vector3i& step : {Eigen::Vector3i(1, 1, 0), Eigen::Vector3i(1, 0, -1),
                                      Eigen::Vector3i(0, 1, 1), Eigen::Vector3i(1, 1, -1)}) {
    VoxelGrid grid = EmptyGrid(8);
    Fill(grid, 3, 3, 3);
    Fill(grid, 3 + step.x(), 3 + step.y(), 3 + step.z());
    EXPECT_FALSE(IsManifold(BoundaryOf(grid, kAllComponents))) << step.transpose();
    EXPECT_GT(MakeManifold(grid), 0u);
    EXPECT_TRUE(IsManifold(BoundaryOf(grid, kAllComponents))) << step.transpose();
  }
}

TEST(MakeManifoldTest, LeavesManifoldsAlone) {
  VoxelGrid grid = EmptyGrid(8);
  Fill(grid, 3, 3, 3);
  Fill(grid, 4, 3, 3);
  Fill(grid, 4, 4, 3);
  EXPECT_EQ(MakeManifold(grid), 0u);
}

TEST(MakeManifoldTest, EndsOnEveryRandomGrid) {
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    VoxelGrid grid = EmptyGrid(12);
    Rng rng(seed);
    for (int i = 0; i < 8 * 8 * 8; ++i) {
      const size_t voxel = grid.Index(2 + i / 64, 2 + i / 8 % 8, 2 + i % 8);
      grid.coverage[voxel] = static_cast<float>(rng.NextBelow(1000)) / 1000.0f;
      grid.filled[voxel] = grid.coverage[voxel] >= grid.least_coverage;
    }
    MakeManifold(grid);
    EXPECT_TRUE(IsManifold(BoundaryOf(grid, kAllComponents))) << seed;
  }
}

TEST(VoxeliseTest, SharesAddUpToTheVolume) {
  // Scanlines run exactly through edges and corners of the box.
  const TriangleMesh box = Box({0.0f, 0.0f, 0.0f}, {1.0f, 0.5f, 0.75f});
  for (const double offset : {0.0, 0.25, 0.125, 0.3}) {
    const auto grid = Voxelise(DoublesOf(box), box.triangles,
                               {.cell = 0.125, .offset = Eigen::Vector3d::Constant(offset)}, RunContext{});
    ASSERT_TRUE(grid.ok()) << grid.status();
    const double volume = std::accumulate(grid->coverage.begin(), grid->coverage.end(), 0.0);
    EXPECT_NEAR(volume * 0.125 * 0.125 * 0.125, 0.375, 1e-6) << offset;
  }
}

TEST(VoxeliseTest, CavitiesAreEmptyAndOverlapsAreCountedOnce) {
  const TriangleMesh outer = Box({0.0f, 0.0f, 0.0f}, {1.0f, 1.0f, 1.0f});
  TriangleMesh inner = Box({0.25f, 0.25f, 0.25f}, {0.75f, 0.75f, 0.75f});
  const auto volume = [&](const TriangleMesh& mesh) {
    const auto grid = Voxelise(DoublesOf(mesh), mesh.triangles, {.cell = 0.125}, RunContext{});
    return std::accumulate(grid->coverage.begin(), grid->coverage.end(), 0.0) / 512.0;
  };
  EXPECT_NEAR(volume(Together(outer, inner)), 1.0, 1e-6);
  for (Triangle& triangle : inner.triangles) {
    std::swap(triangle[1], triangle[2]);
  }
  EXPECT_NEAR(volume(Together(outer, inner)), 0.875, 1e-6);
}

TEST(VoxeliseTest, KeepsTheGenusOfSmoothSolids) {
  for (const char* name : {"cube-sphere", "torus", "genus3"}) {
    const TriangleMesh mesh = Halved(*BuiltinShape(name));
    auto grid = Voxelise(DoublesOf(mesh), mesh.triangles, {.cell = 0.06}, RunContext{});
    ASSERT_TRUE(grid.ok());
    MakeManifold(*grid);
    const VoxelSurface surface = BoundaryOf(*grid, kAllComponents);
    EXPECT_EQ(surface.topology, *CheckClosedSurface(mesh)) << name;
    EXPECT_TRUE(IsManifold(surface)) << name;
  }
}

TEST(VoxeliseTest, NamesTheNumberOfVoxelsAndTheLimit) {
  const TriangleMesh box = Box({0.0f, 0.0f, 0.0f}, {1.0f, 1.0f, 1.0f});
  const absl::Status status = Voxelise(DoublesOf(box), box.triangles, {.cell = 1e-3}, RunContext{}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(std::string(status.message()).find("the limit is 67108864"), std::string::npos);
}

TEST(BoundaryOfTest, KeepsTheLargestComponents) {
  VoxelGrid grid = EmptyGrid(12);
  Fill(grid, 3, 3, 3);
  Fill(grid, 7, 7, 7);
  Fill(grid, 7, 7, 8);
  EXPECT_EQ(BoundaryOf(grid, kAllComponents).quads.size(), 16u);
  const VoxelSurface largest = BoundaryOf(grid, 1);
  EXPECT_EQ(largest.quads.size(), 10u);
  EXPECT_EQ(largest.topology, (SurfaceTopology{1, 0}));
  EXPECT_EQ(largest.positions.size(), 12u);
  EXPECT_EQ(largest.num_irregular_vertices, 8u);
}

}  // namespace
}  // namespace tessera
