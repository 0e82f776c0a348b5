// A mip level as layers (wang/tile_set_layers.h): what is sent of a tile set to scenes that are far away.
//
// Components are the principal ones of what texels reflect in the cases of scene_cases.h, expressed in the
// coefficients by regression: reduced-rank regression [Izenman 1975]. Their images are cosine-transformed by
// tile and quantised uniformly; steps fall to a third, the same for all components, which is where a given
// error costs the fewest bytes. At each step one layer makes the images that are here finer, the next brings
// more components. For the same reason a coefficient that needs entries of tables comes only once it saves
// more error than as many bytes of images, and so does a component.
//
//   TESSERA_ASSIGN_OR_RETURN(LevelLayers far, MakeLevelLayers(level.tile_set, SceneLight::kPoint, context));
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/scene_light.h"
#include "btf/wang/tile_set.h"
#include "btf/wang/tile_set_layers.h"

namespace tessera {

// Layers end when the error is at most this.
inline constexpr double kLevelEndRmse = 0.004;

struct LevelLayers {
  std::shared_ptr<const TileSetLayers> layers;
  // Of each prefix, as Refinement::rmse, before values are rounded to 8 bits; never rises.
  std::vector<double> rmse;
  std::string directions;  // what the errors are over, in words
};

// Same tile set, same result. Cost: a product of all texels' coefficients with at most 96 components. Errors:
// as MakeRefinement.
[[nodiscard]] absl::StatusOr<LevelLayers> MakeLevelLayers(const TileSet& level, SceneLight light,
                                                          const RunContext& context);

}  // namespace tessera
