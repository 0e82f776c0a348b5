// Which texel of which strip a tile shows along its sides: the index maps of design section 4, written once.
//
//        side 2 (north)          A side is walked counter-clockwise: `along` counts from the vertex where it
//       +---<----------+         starts, `depth` from the border inwards.
//       |              |           '+': along runs with the strip, and the tile shows the strip's upper half
//       v   depth      ^                (rows 0 .. h/2-1), the row at the centre line (h/2-1) on the border.
//       |     ^        | side 1    '-': along runs against it, and the tile shows the lower half, row h/2 on
//       |     |        |                the border.
//       +---->---------+         A strip lies left to right, row 0 on top; shown on side k it is turned by k
//        side 0 (south)          quarter turns, plus a half turn for '-'.
//
// Vertical strips of plane-* are stored lying down, with texels of turn 3 (cut from the exemplar turned three
// quarters), so that on sides 1 and 3 their texels stand unturned.
#pragma once

#include <array>
#include <vector>

#include "btf/wang/arrangement.h"

namespace tessera {

// A texel of a strip and the quarter turns it takes on when shown.
struct StripTexel {
  int x = 0;
  int y = 0;
  int turns = 0;
};

// What side `side` with `sign` shows at (along, depth), 0 <= along < w, 0 <= depth < h / 2.
StripTexel StripTexelAt(int side, Sign sign, int along, int depth, int tile_size, int strip_height);

// Column and row of a tile at (along, depth) of a side.
std::array<int, 2> TilePixelAt(int side, int along, int depth, int tile_size);

// Column and row, in the tile as listed, of what stands at column x, row y of the tile turned by `turns`
// quarter turns counter-clockwise.
std::array<int, 2> TilePixelBeforeTurns(int x, int y, int turns, int tile_size);

// The strips of an arrangement, numbered: by colour in surface-*; horizontal colours, then vertical ones, in
// plane-*.
int NumStrips(const Arrangement& arrangement);
int StripOfSide(const Arrangement& arrangement, int side, int colour);
// Turns that the texels of a strip may have, in the strip's own frame.
std::vector<int> TurnsOfStrip(const Arrangement& arrangement, int strip);
// Turns that the texels of a tile's inside may have.
std::vector<int> TurnsOfInterior(const Arrangement& arrangement);
// Turns that one tile may be laid with against another: 0 alone where every code that a turn makes of another
// is listed, for then dressings turn no tile, and in plane-*, where they turn all alike.
std::vector<int> TurnsOfTiles(const Arrangement& arrangement);

// One end of a strip: h / 2 columns, h rows.
enum class StripEnd { kStart = 0, kEnd = 1 };

// A side of a tile as seen from a corner: the strip, and which quarter of which of its ends lies there.
struct CornerSide {
  int strip = 0;
  Sign sign = Sign::kPlus;
  friend bool operator==(const CornerSide&, const CornerSide&) = default;
};

// Two sides that meet at the corner of some tile: `in` ends there, `out` starts there (counter-clockwise).
// The end of the strip that lies there: '+' sides end with the strip's end, '-' sides with its start.
struct CornerPair {
  CornerSide in;
  CornerSide out;
  friend bool operator==(const CornerPair&, const CornerPair&) = default;
};

inline StripEnd EndAtCorner(const CornerSide& side, bool starts_here) {
  return (side.sign == Sign::kPlus) == starts_here ? StripEnd::kStart : StripEnd::kEnd;
}

// Every pair that meets in the arrangement, each once, in order of first appearance.
std::vector<CornerPair> CornerPairs(const Arrangement& arrangement);
// The pair at the corner where side `side` of the tile starts.
CornerPair CornerPairOf(const Arrangement& arrangement, const TileSides& sides, int side);

}  // namespace tessera
