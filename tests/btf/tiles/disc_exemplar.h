// An exemplar with features that a person would pick: discs on a bumpy ground.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {

struct Disc {
  double x = 0.0;
  double y = 0.0;
  double radius = 0.0;

  [[nodiscard]] bool Covers(int px, int py) const { return std::hypot(px - x, py - y) <= radius; }
};

// BumpyEmbedding, whose first dimension stands higher on the discs, in all turns.
inline Embedding DiscEmbedding(int width, int height, uint64_t seed, const std::vector<Disc>& discs) {
  constexpr float kRise = 1.5f;
  Embedding embedding = BumpyEmbedding(width, height, seed);
  for (int turn = 0; turn < 4; ++turn) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        for (const Disc& disc : discs) {
          if (disc.Covers(x, y)) {
            embedding.values[((static_cast<size_t>(turn) * height + y) * width + x) * embedding.dims] +=
                kRise;
          }
        }
      }
    }
  }
  return embedding;
}

}  // namespace tessera
