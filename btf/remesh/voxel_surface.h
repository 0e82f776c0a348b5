// The boundary of the voxels that a closed surface covers, as an all-quad manifold.
//
//   TESSERA_ASSIGN_OR_RETURN(VoxelGrid grid, Voxelise(positions, triangles, {.cell = 0.01}, context));
//   MakeManifold(grid);
//   VoxelSurface surface = BoundaryOf(grid, /*most_components=*/1);
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/base/run_context.h"
#include "btf/remesh/triangle_mesh.h"

namespace tessera {

// Most voxels of a grid: 64 million, of 5 bytes.
inline constexpr int64_t kMaxVoxels = int64_t{1} << 26;

struct VoxelParams {
  double cell = 0.0;  // side of a voxel, > 0
  // Where the box of the surface begins within a voxel, in voxels, 0..1.
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  // Voxels are filled from this covered share of their volume, 0..1. Thin parts survive low ones.
  double least_coverage = 0.5;
};

// Voxel (x, y, z) has index (x size.y + y) size.z + z and spans origin + cell [x, x + 1] and so on. The outer
// two layers are empty.
struct VoxelGrid {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  double cell = 0.0;
  double least_coverage = 0.5;
  std::vector<float> coverage;  // share of the voxel's volume that is inside, 0..1
  std::vector<uint8_t> filled;  // 0 or 1

  [[nodiscard]] size_t Index(int x, int y, int z) const {
    return (static_cast<size_t>(x) * size.y() + y) * size.z() + z;
  }
};

// Covered shares by scanlines along z, four to a voxel, from the winding number in double precision: inside
// is where it is positive. Each scanline meets each edge of the surface on exactly one side, so no crossing
// is lost or counted twice. The surface is closed and wound outwards. Errors: RESOURCE_EXHAUSTED naming the
// number of voxels and kMaxVoxels, CANCELLED.
[[nodiscard]] absl::StatusOr<VoxelGrid> Voxelise(std::span<const Eigen::Vector3d> positions,
                                                 std::span<const Triangle> triangles,
                                                 const VoxelParams& params, const RunContext& context);

// Fills and empties voxels until the boundary is a manifold: the eight voxels about each corner of the grid
// are all alike, or the filled and the empty ones each hang together by faces and no edge has two of each
// kind crosswise. Voxels of shares nearest to the threshold change first, each at most once, and after that
// they are only filled, so it ends. Returns how many changed.
size_t MakeManifold(VoxelGrid& grid);

struct VoxelSurface {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Quad> quads;  // counter-clockwise seen from outside
  SurfaceTopology topology;
  size_t num_irregular_vertices = 0;  // where other than four quads meet
};

// The faces between filled and empty voxels. Of components beyond the `most_components` largest, which are
// crumbs of thin parts, nothing is kept. `grid` is one that MakeManifold left.
[[nodiscard]] VoxelSurface BoundaryOf(const VoxelGrid& grid, size_t most_components);

}  // namespace tessera
