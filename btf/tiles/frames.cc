#include "btf/tiles/frames.h"

#include "btf/tiles/exemplar.h"

namespace tessera {

std::vector<uint32_t> BuildFrame(const Arrangement& arrangement, const TileSides& sides,
                                 const Corners& corners, std::span<const Strip> strips) {
  const int height = corners.strip_height;
  const int half = height / 2;
  const int size = strips.front().width;
  std::vector<uint32_t> frame(static_cast<size_t>(size) * size, kNoTexel);
  for (int side = 0; side < 4; ++side) {
    const Strip& strip = strips[StripOfSide(arrangement, side, sides[side].colour)];
    const CornerCut& start_cut = corners.cut(CornerPairOf(arrangement, sides, side));
    const CornerCut& end_cut = corners.cut(CornerPairOf(arrangement, sides, (side + 1) & 3));
    for (int along = 0; along < size; ++along) {
      for (int depth = 0; depth < half; ++depth) {
        bool shown = true;
        if (along < half) {
          shown = start_cut.in_wins[static_cast<size_t>(depth) * half + along] == 0;
        } else if (along >= size - half) {
          shown = end_cut.in_wins[static_cast<size_t>(size - 1 - along) * half + depth] != 0;
        }
        if (shown) {
          const auto [x, y] = TilePixelAt(side, along, depth, size);
          const StripTexel at = StripTexelAt(side, sides[side].sign, along, depth, size, height);
          frame[static_cast<size_t>(y) * size + x] = TurnTexel(strip.texel(at.x, at.y), at.turns);
        }
      }
    }
  }
  return frame;
}

}  // namespace tessera
