#include "btf/tiles/tile_sides.h"

#include <algorithm>

namespace tessera {

StripTexel StripTexelAt(int side, Sign sign, int along, int depth, int tile_size, int strip_height) {
  const int half = strip_height / 2;
  if (sign == Sign::kPlus) {
    return {along, half - 1 - depth, side & 3};
  }
  return {tile_size - 1 - along, half + depth, (side + 2) & 3};
}

std::array<int, 2> TilePixelAt(int side, int along, int depth, int tile_size) {
  const int last = tile_size - 1;
  switch (side & 3) {
    case 1:
      return {last - depth, last - along};
    case 2:
      return {last - along, depth};
    case 3:
      return {depth, along};
    default:
      return {along, last - depth};
  }
}

std::array<int, 2> TilePixelBeforeTurns(int x, int y, int turns, int tile_size) {
  for (int turn = 0; turn < turns; ++turn) {
    const int turned_x = tile_size - 1 - y;
    y = x;
    x = turned_x;
  }
  return {x, y};
}

int NumStrips(const Arrangement& arrangement) {
  return arrangement.turned_strips ? arrangement.num_colours : 2 * arrangement.num_colours;
}

int StripOfSide(const Arrangement& arrangement, int side, int colour) {
  const bool vertical = (side & 1) != 0;
  return colour + (!arrangement.turned_strips && vertical ? arrangement.num_colours : 0);
}

std::vector<int> TurnsOfStrip(const Arrangement& arrangement, int strip) {
  if (arrangement.turned_strips) {
    return {0, 1, 2, 3};
  }
  return {strip < arrangement.num_colours ? 0 : 3};
}

std::vector<int> TurnsOfInterior(const Arrangement& arrangement) {
  return arrangement.turned_strips ? std::vector<int>{0, 1, 2, 3} : std::vector<int>{0};
}

std::vector<int> TurnsOfTiles(const Arrangement& arrangement) {
  const auto is_listed_turned = [&](uint32_t code) {
    const TileSides sides = SidesFromTileCode(code, arrangement.num_colours);
    return arrangement.IndexOfCode(TileCode(SidesCountedFrom(sides, 1), arrangement.num_colours)) >= 0;
  };
  const bool turned = arrangement.turned_strips && !std::ranges::all_of(arrangement.codes, is_listed_turned);
  return turned ? std::vector<int>{0, 1, 2, 3} : std::vector<int>{0};
}

CornerPair CornerPairOf(const Arrangement& arrangement, const TileSides& sides, int side) {
  const int before = (side + 3) & 3;
  return {.in = {StripOfSide(arrangement, before, sides[before].colour), sides[before].sign},
          .out = {StripOfSide(arrangement, side, sides[side].colour), sides[side].sign}};
}

std::vector<CornerPair> CornerPairs(const Arrangement& arrangement) {
  std::vector<CornerPair> pairs;
  for (size_t tile = 0; tile < arrangement.codes.size(); ++tile) {
    const TileSides sides = arrangement.SidesOf(tile);
    for (int side = 0; side < 4; ++side) {
      const CornerPair pair = CornerPairOf(arrangement, sides, side);
      if (std::find(pairs.begin(), pairs.end(), pair) == pairs.end()) {
        pairs.push_back(pair);
      }
    }
  }
  return pairs;
}

}  // namespace tessera
