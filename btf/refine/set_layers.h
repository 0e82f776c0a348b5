// The coefficients of a tile set, or of a level of one, as layers (wang/tile_set_layers.h).
//
// Components are the principal ones of what texels reflect in the cases of scene_cases.h, expressed in the
// coefficients by regression: reduced-rank regression [Izenman 1975]. Their images are cosine-transformed by
// block and quantised uniformly; steps fall to a third, the same for all components, which is where a given
// error costs the fewest bytes. At each step one layer makes the images that are here finer, the next brings
// more components. For the same reason a coefficient that needs entries of tables comes only once it saves
// more error than as many bytes of images, and so does a component.
//
//   TESSERA_ASSIGN_OR_RETURN(SetLayers far, MakeSetLayers(level.btfels, {.block_side = level.tile_size},
//   context));
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/btfel_table.h"
#include "btf/codec/scene_light.h"
#include "btf/wang/tile_set_layers.h"

namespace tessera {

// Components at most.
inline constexpr int kMostComponents = 128;
// Layers end when the error is at most this: one step of a picture of 8 bits.
inline constexpr double kLayersEndRmse = 0.004;

struct SetLayersOptions {
  int block_side = 1;               // the table has whole blocks of block_side^2 BTFels
  std::span<const uint32_t> exact;  // coefficients that are there without layers
  double rmse = INFINITY;           // with these alone
  SceneLight light = SceneLight::kPoint;
};

struct SetLayers {
  std::shared_ptr<const TileSetLayers> layers;  // where nothing is exact also rounded tables
  // With each further layer, as Refinement::rmse, before values are rounded to 8 bits; falls strictly.
  std::vector<double> rmse;
};

// Same arguments, same result. Cost: a product of all BTFels' coefficients with at most kMostComponents
// components. Errors: MakeDecoder's; CANCELLED.
[[nodiscard]] absl::StatusOr<SetLayers> MakeSetLayers(const BtfelTable& table,
                                                      const SetLayersOptions& options,
                                                      const RunContext& context);

}  // namespace tessera
