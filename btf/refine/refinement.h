// In which parts a tile set, or a level of one, is worth sending, and how far each prefix of them is from the
// whole.
//
//   a tile set   first the coefficients that matter most, as they are, so few that they can be drawn at once;
//   then all others in
//                layers (set_layers.h); then those as they are. Of no more coefficients than layers would
//                have components, more and more of them, as they are
//   a level      layers alone
//
// A coefficient's energy is the sum over cases of its weight^2, times its variance about its fill over the
// BTFels: what leaving it out alone costs in reflectance.
//
//   TESSERA_ASSIGN_OR_RETURN(Refinement refinement, MakeRefinement(tile_set, {}, context));
//   refinement.cut.tiles = ..;
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/scene_light.h"
#include "btf/wang/tile_set.h"
#include "btf/wang/tile_set_parts.h"

namespace tessera {

// Exact coefficients come in parts of about so many bytes before they are compressed.
inline constexpr size_t kExactPartBytes = size_t{4} << 20;

struct RefinementOptions {
  int level = 0;  // of a set that MakeLevelSet made, its level
  SceneLight light = SceneLight::kPoint;
};

struct Refinement {
  TileSetCut cut;  // of all tiles
  // Of each prefix, RMSE over RGB in reflectance, clamped at 0, against all coefficients, of texels of the
  // level spread over the tiles (SampleTexels), over the cases of scene_cases.h. Never rises; 0 at the last
  // part of a tile set.
  std::vector<double> rmse;
  std::string directions;  // the cases, in words
};

// Same arguments, same result. Errors: MakeDecoder's; those of MakeSetLayers; CANCELLED.
[[nodiscard]] absl::StatusOr<Refinement> MakeRefinement(const TileSet& tile_set,
                                                        const RefinementOptions& options,
                                                        const RunContext& context);

}  // namespace tessera
