// What surface-26 shows, as the tiles of surface-96 that show the same.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "btf/wang/arrangement.h"
#include "btf/wang/tile_set.h"

namespace tessera {

// A tile as a picture, turned as numpy.rot90 does: texels move and take the turns on.
inline std::vector<uint32_t> TurnedTexels(std::span<const uint32_t> tile, int size, int turns) {
  std::vector<uint32_t> picture(tile.begin(), tile.end());
  for (int i = 0; i < (turns & 3); ++i) {
    std::vector<uint32_t> turned(picture.size());
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const uint32_t texel = picture[static_cast<size_t>(y) * size + x];
        turned[static_cast<size_t>(size - 1 - x) * size + y] =
            PackTexel(BtfelOfTexel(texel), TurnsOfTexel(texel) + 1);
      }
    }
    picture.swap(turned);
  }
  return picture;
}

// [96][size][size] from [26][size][size]: each code of surface-96 as a turned tile of surface-26.
inline std::vector<uint32_t> Surface96FromSurface26(std::span<const uint32_t> tiles, int size) {
  const Arrangement& few = **FindArrangement("surface-26");
  const Arrangement& all = **FindArrangement("surface-96");
  const size_t area = static_cast<size_t>(size) * size;
  std::vector<uint32_t> expanded;
  for (size_t i = 0; i < all.codes.size(); ++i) {
    const Arrangement::Laid laid = few.TileShowing(all.SidesOf(i));
    std::ranges::copy(TurnedTexels(tiles.subspan(laid.tile * area, area), size, laid.turns),
                      std::back_inserter(expanded));
  }
  return expanded;
}

}  // namespace tessera
