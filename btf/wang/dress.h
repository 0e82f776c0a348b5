// Dresses a quad mesh: subdivides it until its quads are of similar size, then gives each quad a tile of an
// arrangement and the quarter turns it is laid with, so that sides match across every edge.
//
//   TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement("surface-96"));
//   TESSERA_ASSIGN_OR_RETURN(DressResult result, DressMesh(mesh, *arrangement, {.seed = 7}, context));
//
// Same mesh, arrangement, seed and target: same dressing, on every machine.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dressing.h"
#include "btf/wang/quad_mesh.h"

namespace tessera {

struct DressParams {
  uint64_t seed = 1;
  // Accept edges across which an unturned arrangement ("plane-*") cannot match; they are listed either way.
  bool allow_breaks = false;
  // Subdivide to about this many quads, 0 for the rule of subdivide.h. Meshes are never coarsened.
  uint32_t target_quads = 0;
};

// An edge of the subdivided mesh whose two tiles do not match.
struct Break {
  uint32_t face = 0;  // the lower of the two faces
  uint8_t side = 0;   // of the face, not of the tile
  uint32_t other_face = 0;
  uint8_t other_side = 0;

  friend bool operator==(const Break&, const Break&) = default;
};

struct DressResult {
  Dressing dressing;
  std::vector<Break> breaks;  // ascending by (face, side)
};

// Errors: INVALID_ARGUMENT (no quads, a mesh that BuildAdjacency refuses, target_quads beyond the limit),
// FAILED_PRECONDITION naming the number of breaks and the first ones' edges unless params.allow_breaks,
// CANCELLED. Cost: linear in the number of quads, about 1 s for a million.
// Source: [Fu2005] 3, [Leung2007] 4.1.
[[nodiscard]] absl::StatusOr<DressResult> DressMesh(const QuadMesh& mesh, const Arrangement& arrangement,
                                                    const DressParams& params, const RunContext& context);

// The edges across which tiles do not match: colours or signs differ, or, without turned strips, the tiles
// are turned against each other. Errors: INVALID_ARGUMENT naming the quad whose tile or turn does not exist.
[[nodiscard]] absl::StatusOr<std::vector<Break>> FindBreaks(const Dressing& dressing,
                                                            const Arrangement& arrangement);

}  // namespace tessera
