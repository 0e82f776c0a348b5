// How far two patches differ where they overlap, and how far they may: the PCA-weighted error and threshold
// of [PCAWang 4.2].
//
// The paper sums squared differences over the N pixels of the overlap and the c principal components,
// weighted by the components' coefficients in light direction m and view direction v, and bounds the sum by a
// threshold made from the PCA with a sensitivity parameter epsilon. Its equations 3 and 4 are missing from
// our copy; our form, for the points p of an embedding,
//
//   d = (1 / N) sum over k = 1..N sum over i = 1..c (p1_ki - p2_ki)^2
//   d_max = epsilon^2 * 2 sum over i = 1..c variance_i
//
// The weights do not show: an embedding's components are unit vectors over all pairs of a light and a view,
// so they are in its points already. Twice the variance is the mean of d over texels drawn at random: epsilon
// 0 accepts only what is equal, 1 what is no worse than chance.
//
//   bool fits = OverlapError(embedding, 5, overlap) < OverlapErrorThreshold(embedding, 5,
//   /*sensitivity=*/0.3);
#pragma once

#include <span>

#include "btf/codec/codec.h"

namespace tessera {

// A texel of the exemplar (x, y) seen after `turn` quarter turns.
struct TurnedTexel {
  int x = 0;
  int y = 0;
  int turn = 0;
};

// Two patches at one pixel of their overlap.
struct OverlapPixel {
  TurnedTexel first;
  TurnedTexel second;
};

// d above, >= 0; 0 for an empty overlap. Texels lie in the exemplar; components beyond those of the embedding
// count as 0.
[[nodiscard]] double OverlapError(const Embedding& embedding, int num_components,
                                  std::span<const OverlapPixel> overlap);

// d_max above. sensitivity >= 0.
[[nodiscard]] double OverlapErrorThreshold(const Embedding& embedding, int num_components,
                                           double sensitivity);

}  // namespace tessera
