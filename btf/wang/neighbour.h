// What lies across the four sides of each dressed tile: for bilinear filtering across tile borders.
//
// Everything is in tile frames. Texel (x, y) of a tile, row 0 on top; tile side s = 0 south, 1 east, 2 north,
// 3 west; position p = 0..w-1 counts counter-clockwise from the start of the side (south: eastwards, east:
// northwards, north: westwards, west: southwards) and depth d = 0.. inwards from it:
//
//   (x, y) = south (p, w-1-d), east (w-1-d, w-1-p), north (w-1-p, d), west (d, p)
//
// Let face f with turns r_f meet face g with turns r_g, f's side k against g's side j. Tile side s = k - r_f
// of f lies on tile side s' = j - r_g of g (all mod 4), and they run against each other:
//
//   the texel beyond (side s, position p) of f's tile, depth d outwards, is (side s', position w-1-p, depth
//   d) of g's tile; as f's frame sees it, g's tile is turned counter-clockwise by
//
//   turns = (s + 2 - s') mod 4 = (k + 2 - j) + (r_g - r_f) mod 4
//
// quarter turns. A texel of g whose index says k_t turns therefore decodes in f's frame (t, b) with k_t +
// turns, and in g's own frame with k_t.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/wang/dressing.h"

namespace tessera {

struct TileNeighbour {
  int32_t face = -1;  // -1 at an open boundary
  uint8_t side = 0;   // tile side of `face` that lies on this one
  uint8_t turns = 0;  // counter-clockwise quarter turns of its tile as seen in this tile's frame
};

// [quads][tile side]. Independent of the tile set, so it stays as it is when a mesh is re-dressed.
// Errors: as BuildAdjacency, and INVALID_ARGUMENT when `turns` has not one entry in 0..3 a quad.
[[nodiscard]] absl::StatusOr<std::vector<std::array<TileNeighbour, 4>>> BuildTileNeighbours(
    const Dressing& dressing);

struct TexelPosition {
  int x = 0;
  int y = 0;
};

// The texel at position p along side s of a w x w tile, d texels inwards. s in 0..3, p and d in [0, w).
[[nodiscard]] constexpr TexelPosition TexelOnSide(int s, int p, int d, int w) {
  switch (s & 3) {
    case 0:
      return {p, w - 1 - d};
    case 1:
      return {w - 1 - d, w - 1 - p};
    case 2:
      return {w - 1 - p, d};
    default:
      return {d, p};
  }
}

}  // namespace tessera
