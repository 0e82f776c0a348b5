// Step 3 of synthesis: four half-strips joined with the cuts of step 1, clipped to the tile.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "btf/tiles/corners.h"
#include "btf/tiles/edges.h"

namespace tessera {

// The frame of the tile with these sides, [w][w], kNoTexel in the inside: h / 2 texels deep on every side.
std::vector<uint32_t> BuildFrame(const Arrangement& arrangement, const TileSides& sides,
                                 const Corners& corners, std::span<const Strip> strips);

}  // namespace tessera
