// In which order the coefficients of a tile set are worth sending, and how far a prefix of them is from the
// whole.
//
// A coefficient that is left out has its mean over the texels (0 where its meaning depends on a codec's
// tables). Its energy is the sum over directions of its weight^2, times its variance about that value over
// the texels: what leaving it out alone costs in reflectance. Prefixes grow by about 1.4 times; one that
// would not lower the error is joined with the next, so that errors fall strictly or are 0.
//
// Errors are RMSE over RGB in reflectance, clamped at 0, against all coefficients, of texels spread evenly
// over the tiles, each in its own frame, over the cases of scene_cases.h.
//
//   TESSERA_ASSIGN_OR_RETURN(Refinement refinement, MakeRefinement(tile_set, SceneLight::kPoint, context));
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/scene_light.h"
#include "btf/wang/tile_set.h"

namespace tessera {

inline constexpr int kRefineTexels = 1024;

struct Refinement {
  std::vector<uint32_t> order;  // [k], by falling energy, ties by index
  std::vector<float> fill;      // [k]
  std::vector<uint32_t> ends;   // of the prefixes, ascending up to k
  std::vector<double> rmse;     // of each prefix; 0 at the last
  std::string directions;       // what the errors are over, in words
};

// Same tile set, same result. Cost: kRefineTexels times 2 kRefineViews times k products. Errors:
// INVALID_ARGUMENT when texels name BTFels that do not exist; MakeDecoder's; CANCELLED.
[[nodiscard]] absl::StatusOr<Refinement> MakeRefinement(const TileSet& tile_set, SceneLight light,
                                                        const RunContext& context);

}  // namespace tessera
