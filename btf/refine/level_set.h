// What scenes need of a tile set whose finest mip level they show is level l, as a tile set of its own: tiles
// of w / S texels. S is 2^(l - 1), so that each texel of the level is the mean of 2 x 2 of them, but at most
// a quarter of the strip height: patches would be lost.
//
// A texel stands for a cell of S x S texels. It shows the patch that most of the cell shows, as the mean over
// the S x S pixels that the cell covers in the exemplar: seams move by less than half a cell. So its BTFels
// lie in the exemplar as those of the tile set do (SourceGrid), no patch's turn mixes with another's, and
// what is there is as smooth as the material.
//
//   TESSERA_ASSIGN_OR_RETURN(LevelSet far, MakeLevelSet(tile_set, /*level=*/3, context));
#pragma once

#include <cstdint>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/wang/tile_set.h"

namespace tessera {

struct LevelSet {
  // No seams or certificate. Of level 1 the tile set's own texels.
  TileSet tile_set;
  // RMSE of texels of the level, in reflectance, over some spread over the tiles and a few measured
  // directions: of moved seams and of 8 bits.
  double rmse = 0.0;
};

// Cost: a pass over the coefficients of all pixels of cells. Errors: INVALID_ARGUMENT naming a level that the
// tile size does not have; FAILED_PRECONDITION where the tile set does not say where its BTFels lie in the
// exemplar; those of MakeDecoder; CANCELLED.
[[nodiscard]] absl::StatusOr<LevelSet> MakeLevelSet(const TileSet& tile_set, int level,
                                                    const RunContext& context);

}  // namespace tessera
