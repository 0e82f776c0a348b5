// The coefficients of a tile set, or of a level of one, as layers (wang/tile_set_layers.h).
//
// Components are the principal ones of what texels of the level reflect in the cases of scene_cases.h,
// expressed in the coefficients by regression: reduced-rank regression [Izenman 1975]. Their images over the
// exemplar, not over the tiles that repeat it, are cosine-transformed by block and quantised by what is seen
// of each frequency; steps fall to a third, the same for all components, which is where a given error costs
// the fewest bytes. At each step one layer brings more components, each once it saves more error than as many
// bytes of images, and finer tables; the next makes the images that are here finer.
//
//   TESSERA_ASSIGN_OR_RETURN(SetLayers far, MakeSetLayers(level.tile_set, {.level = 3}, context));
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/scene_light.h"
#include "btf/wang/tile_set.h"
#include "btf/wang/tile_set_layers.h"

namespace tessera {

// Components at most.
inline constexpr int kMostComponents = 192;
// Layers end when the error is at most this, one step of a picture of 8 bits, or with a step of 1/16384.
inline constexpr double kLayersEndRmse = 0.004;

struct SetLayersOptions {
  int level = 0;                    // the finest mip level that is seen
  std::span<const uint32_t> exact;  // coefficients that are there without layers
  double rmse = INFINITY;           // with these alone
  SceneLight light = SceneLight::kPoint;
};

struct SetLayers {
  std::shared_ptr<const TileSetLayers> layers;  // where nothing is exact also tables, as cores
  // With each further layer, as Refinement::rmse, before values are rounded to 8 bits; falls strictly.
  std::vector<double> rmse;
};

// Same arguments, same result. Cost: a product of all BTFels' coefficients with at most kMostComponents
// components. Errors: MakeDecoder's; CANCELLED.
[[nodiscard]] absl::StatusOr<SetLayers> MakeSetLayers(const TileSet& tile_set,
                                                      const SetLayersOptions& options,
                                                      const RunContext& context);

}  // namespace tessera
