// Remeshes closed triangle surfaces into quads of similar size, by the PolyCube idea: the boundary of the
// voxels that the surface covers is a mesh of squares; relaxed on the surface, it is one of about squares.
//
//   TESSERA_ASSIGN_OR_RETURN(TriangleMesh bunny, ReadTriangleMesh("bunny.off"));
//   TESSERA_ASSIGN_OR_RETURN(RemeshResult result, RemeshTriangles(bunny, {.target_quads = 4000}, context));
//   std::string obj = WriteObj(result.mesh);
//
// The axes of the voxels are those of the mesh. Same mesh and target: same result, for any number of threads.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/remesh/triangle_mesh.h"
#include "btf/wang/quad_mesh.h"

namespace tessera {

inline constexpr uint32_t kMinRemeshQuads = 100;
inline constexpr uint32_t kMaxRemeshQuads = 1'000'000;
inline constexpr uint32_t kDefaultRemeshQuads = 4000;
// The number of quads is within this share of the target, unless the report says otherwise.
inline constexpr double kQuadsTolerance = 0.1;

// Beyond these limits RemeshReport::Warnings names the figure.
inline constexpr double kMaxMeanAngleDeviationDeg = 15.0;
inline constexpr double kMaxWorstAngleDeviationDeg = 75.0;
inline constexpr double kMaxWorstAreaRatio = 8.0;
inline constexpr double kMaxSurfaceDistance = 0.02;  // of the diagonal of the box

struct RemeshParams {
  uint32_t target_quads = kDefaultRemeshQuads;
};

struct RemeshReport {
  size_t num_quads = 0;
  size_t target_quads = 0;
  SurfaceTopology topology_in;
  SurfaceTopology topology_out;
  // Of a quad's area and the mean one, the larger over the smaller: 1 is even.
  double mean_area_ratio = 0.0;
  double worst_area_ratio = 0.0;
  // Of |angle - 90 degrees| over the corners of all quads.
  double mean_angle_deviation_deg = 0.0;
  double worst_angle_deviation_deg = 0.0;
  // Quads that face against the surface or have a corner that turns against the quad's normal.
  size_t num_flipped = 0;
  // From the input's vertices to the quads and from the quads' centres to the input, over the diagonal of the
  // input's box.
  double mean_distance = 0.0;
  double worst_distance = 0.0;
  size_t num_on_creases = 0;  // vertices on sharp edges

  // A sentence for each figure beyond its limit, and for a topology that differs.
  [[nodiscard]] std::vector<std::string> Warnings() const;
};

struct RemeshResult {
  QuadMesh mesh;
  RemeshReport report;
};

// Quads about `params.target_quads`; vertices lie on the surface, on its sharp edges (40 degrees and more)
// where that leaves the quads in shape. Among sizes and places of the voxels those are taken that keep the
// number of components and handles and miss few thin parts, with the fewest irregular vertices. Errors:
// INVALID_ARGUMENT (the target is outside the limits above, no volume, so far from the origin that a side is
// lost to rounding, and what CheckClosedSurface refuses), RESOURCE_EXHAUSTED naming the number of voxels and
// the limit, FAILED_PRECONDITION naming the first quad's place and the number of quads that stay flipped,
// INTERNAL when Embree fails, CANCELLED. Cost: seconds for 10 000 quads.
[[nodiscard]] absl::StatusOr<RemeshResult> RemeshTriangles(const TriangleMesh& mesh,
                                                           const RemeshParams& params,
                                                           const RunContext& context);

}  // namespace tessera
