// Made-up exemplars for tests of synthesis.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "btf/base/rng.h"
#include "btf/codec/codec.h"
#include "btf/tiles/exemplar.h"

namespace tessera {

// Smooth noise that wraps around, values about 0.
inline std::vector<double> SmoothNoise(int width, int height, int num_blurs, uint64_t seed) {
  Rng rng(seed);
  std::vector<double> noise(static_cast<size_t>(width) * height);
  for (double& value : noise) {
    value = rng.NextDouble() - 0.5;
  }
  for (int blur = 0; blur < num_blurs; ++blur) {
    std::vector<double> out(noise.size(), 0.0);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        for (int i = 0; i < 9; ++i) {
          const int xx = (x + i % 3 - 1 + width) % width;
          const int yy = (y + i / 3 - 1 + height) % height;
          out[static_cast<size_t>(y) * width + x] += noise[static_cast<size_t>(yy) * width + xx] / 4.0;
        }
      }
    }
    noise.swap(out);
  }
  return noise;
}

// An isotropic bumpy material: one dimension that no turn changes, and the two slopes of the bumps as the
// picture sees them, which turn with it as lit bumps do.
inline Embedding BumpyEmbedding(int width, int height, uint64_t seed) {
  const std::vector<double> bumps = SmoothNoise(width, height, 2, seed);
  Embedding embedding{.width = width,
                      .height = height,
                      .dims = 3,
                      .values = {},
                      .variance = {1.0, 1.0, 1.0},
                      .total_variance = 4.0};
  embedding.values.resize(size_t{4} * width * height * embedding.dims);
  const auto at = [&](int x, int y) {
    return bumps[static_cast<size_t>((y + height) % height) * width + (x + width) % width];
  };
  for (int turn = 0; turn < 4; ++turn) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        double slope_x = at(x + 1, y) - at(x - 1, y);
        double slope_up = at(x, y - 1) - at(x, y + 1);
        for (int i = 0; i < turn; ++i) {  // counter-clockwise: (x, up) -> (-up, x)
          const double turned_x = -slope_up;
          slope_up = slope_x;
          slope_x = turned_x;
        }
        float* const point =
            embedding.values.data() + ((static_cast<size_t>(turn) * height + y) * width + x) * embedding.dims;
        point[0] = static_cast<float>(at(x, y));
        point[1] = static_cast<float>(slope_x);
        point[2] = static_cast<float>(slope_up);
      }
    }
  }
  return embedding;
}

}  // namespace tessera
