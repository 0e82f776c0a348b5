// What the tiles of one set show in the same place: on a grid of tiles it comes back in step with the grid,
// and the eye finds it at once. The same content somewhere else in another tile is far less seen.
//
//   Siblings siblings(maps.texels, /*size=*/64, /*margin=*/8, /*self=*/3, /*turns=*/{0});
//   bool seen = siblings.Repeats(canvas, window, patch, cut);
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "btf/tiles/seam_graph.h"

namespace tessera {

class Siblings {
 public:
  // `texels` of all tiles, [tiles][size][size], kNoTexel where none is yet, must outlive this; tile `self` is
  // left out. Frames meet in place because tiles share sides, so nothing less than `margin` from the border
  // is looked at. Siblings are seen laid with each of `turns`, quarter turns against `self`.
  Siblings(std::span<const uint32_t> texels, int size, int margin, int self, std::vector<int> turns);

  // Would the cut bring more than 15% of the window's texels from one and the same sibling, in place?
  // Cost: the window's texels times the tiles times their turns.
  [[nodiscard]] bool Repeats(const Exemplar& exemplar, const Window& window, const Patch& patch,
                             const PatchCut& cut) const;
  // Does a whole tile, [size][size], show more than 15% of its inside in place in one and the same sibling?
  [[nodiscard]] bool Repeats(std::span<const uint32_t> tile) const;

 private:
  // A texel, and where in the tile `self`.
  struct Shown {
    int x = 0;
    int y = 0;
    uint32_t texel = 0;
  };
  [[nodiscard]] bool AnyShows(const std::vector<Shown>& texels, double limit) const;

  std::span<const uint32_t> texels_;
  int size_;
  int margin_;
  int self_;
  std::vector<int> turns_;
};

}  // namespace tessera
