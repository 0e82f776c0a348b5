// What a person may tell synthesis, ready for its four steps: texels that stay, corner samples, and texels of
// the exemplar that patches must not bring [Leung2007] 3.3. features.h makes it from a recipe.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "btf/tiles/exemplar.h"
#include "btf/tiles/seam_graph.h"

namespace tessera {

struct PlacedTexel {
  int x = 0;
  int y = 0;
  uint32_t texel = kNoTexel;
};
// One feature on a strip or a tile: texels that continue each other as they do in the exemplar.
using PlacedFeature = std::vector<PlacedTexel>;

struct Controls {
  std::vector<std::vector<PlacedFeature>> strips;  // by strip, in the strip's frame; empty: none
  std::vector<std::vector<PlacedFeature>> tiles;   // by tile, those on its strips included; empty: none
  std::vector<std::optional<Patch>> corners;       // by 2 * strip + end; empty: none
  std::vector<uint8_t> excluded;                   // by exemplar pixel, 1 where patches must not; empty: none

  [[nodiscard]] const std::vector<PlacedFeature>& on_strip(int strip) const {
    return strips.empty() ? kNothing : strips[strip];
  }
  [[nodiscard]] const std::vector<PlacedFeature>& on_tile(int tile) const {
    return tiles.empty() ? kNothing : tiles[tile];
  }

 private:
  inline static const std::vector<PlacedFeature> kNothing;
};

}  // namespace tessera
