// Whether tiles agree across their common sides.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "btf/tiles/index_maps.h"
#include "btf/tiles/tile_sides.h"
#include "tests/btf/wang/turned_tiles.h"

namespace tessera {

inline std::vector<uint32_t> TurnedTile(const IndexMaps& maps, int tile, int turns) {
  const size_t area = static_cast<size_t>(maps.tile_size) * maps.tile_size;
  return TurnedTexels(std::span(maps.texels).subspan(tile * area, area), maps.tile_size, turns);
}

// Lays '+' side k of A on top of '-' side j of B, turned so that the shared side lies level with A above it,
// and compares the two rows with the strip's two centre rows, texel by texel and turn by turn. In plane-* A
// then stands turned by -k: the vertical strips' own frame.
inline void CheckPair(const IndexMaps& maps, int strip, int a, int k, int b, int j) {
  const int size = maps.tile_size;
  const int height = maps.strips[strip].height;
  const std::vector<uint32_t> above = TurnedTile(maps, a, 4 - k);      // side k to the south
  const std::vector<uint32_t> below = TurnedTile(maps, b, 4 + 2 - j);  // side j to the north
  for (int x = 1; x + 1 < size; ++x) {
    const uint32_t upper = above[(size - 1) * size + x];
    const uint32_t lower = below[x];
    ASSERT_EQ(upper, maps.strips[strip].texel(x, height / 2 - 1))
        << "tile " << a << " side " << k << " texel " << x;
    ASSERT_EQ(lower, maps.strips[strip].texel(x, height / 2))
        << "tile " << b << " side " << j << " texel " << x;
  }
}

// Every pair of tiles and turns that the arrangement allows; returns how many there are.
inline int CheckAllPairs(const IndexMaps& maps, const Arrangement& arrangement) {
  int num_pairs = 0;
  const int num_tiles = static_cast<int>(arrangement.codes.size());
  for (int a = 0; a < num_tiles; ++a) {
    const TileSides sides_a = arrangement.SidesOf(a);
    for (int b = 0; b < num_tiles; ++b) {
      const TileSides sides_b = arrangement.SidesOf(b);
      for (int k = 0; k < 4; ++k) {
        for (int j = 0; j < 4; ++j) {
          const bool opposite = sides_a[k].sign == Sign::kPlus && sides_b[j].sign == Sign::kMinus;
          const bool may_face = arrangement.turned_strips || (j - k + 4) % 4 == 2;
          if (opposite && may_face && sides_a[k].colour == sides_b[j].colour) {
            CheckPair(maps, StripOfSide(arrangement, k, sides_a[k].colour), a, k, b, j);
            ++num_pairs;
          }
        }
      }
    }
  }
  return num_pairs;
}

}  // namespace tessera
