// All tiles of a set as one flat picture, for looking at a synthesis.
//
//   TESSERA_ASSIGN_OR_RETURN(Image sheet, RenderTileSheet(tile_set, SheetParams{}, run_context));
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/image/image.h"
#include "btf/math/conventions.h"
#include "btf/wang/tile_set.h"

namespace tessera {

struct SheetParams {
  Direction light{RadFromDeg(30.0), RadFromDeg(135.0)};  // in the tiles' frame, theta below pi/2
  Direction view{0.0, 0.0};                              // likewise
  int columns = 0;                                       // tiles a row; 0 makes the sheet about square
  int gap = 4;                                           // texels between tiles and around them, 0..256
  // To the right, the same sheet in dark grey with its seams in colour: blue, not more than the material's
  // own steps; green 1.25, yellow 1.5, red 2 times as much and above (TileSet::seam_heat).
  bool seam_heat = false;
};

// Linear RGBA, one pixel a texel, tiles in ascending code from the top left; value of the BTF under an
// irradiance of pi; alpha 1 on tiles and 0 in gaps. Decodes each (BTFel, turn) once. Errors: INVALID_ARGUMENT
// naming the parameter, or the tile set when it is inconsistent or has no heat to show; UNIMPLEMENTED
// (codec); CANCELLED.
[[nodiscard]] absl::StatusOr<Image> RenderTileSheet(const TileSet& tile_set, const SheetParams& params,
                                                    const RunContext& context);

}  // namespace tessera
