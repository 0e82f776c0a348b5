// A mip level of a tile set as a tile set of its own: for scenes that are far away, and need nothing finer.
//
// Where codecs turn coefficients (Codec::Turns) its texels are those of the level (mips/tile_mips.h). Of the
// others a level's texel may have parts of several turns, and a texel of a tile set has one: the part of the
// largest share gives the turn, and the coefficients of the others are turned to it by the k x k matrix that
// errs least, in the least-squares sense, over the measured views with kTurnLights lights each.
//
//   TESSERA_ASSIGN_OR_RETURN(LevelSet far, MakeLevelSet(tile_set, /*level=*/3, context));
#pragma once

#include <cstdint>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/wang/tile_set.h"

namespace tessera {

inline constexpr int kTurnLights = 12;
// Turning by least squares solves for this many unknowns at most.
inline constexpr int kMostTurnedCoefficients = 2048;

struct LevelSet {
  // Tiles of w / 2^level texels, each a BTFel of its own, in the order of the texels; no source pixels, seams
  // or certificate.
  TileSet tile_set;
  // RMSE against the level with its parts, in reflectance, over texels spread over the tiles and a few
  // measured directions: of the turning and, where texels had several parts, of 8 bits.
  double rmse = 0.0;
};

// Cost: MakeTileMips. Errors: its; INVALID_ARGUMENT naming a level that the tile size does not have;
// RESOURCE_EXHAUSTED naming kMostTurnedCoefficients, or the 1 GiB that its texels would pass; CANCELLED.
[[nodiscard]] absl::StatusOr<LevelSet> MakeLevelSet(const TileSet& tile_set, int level,
                                                    const RunContext& context);

}  // namespace tessera
