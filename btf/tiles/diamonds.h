// The baselines: tiles of four diamonds, cut along the tile's diagonals [Cohen2003], [PCAWang] 4.3, by
// dynamic programming or by a minimum cut.
//
// clang-format off
//       +-----------+     Every edge colour has one sample of the exemplar, a square of w x w texels whose
//       |\  north  /|     middle line is the edge; a tile shows one half of it. At each corner the samples of
//       | \   .   / |     two sides overlap near the diagonal, in |i - j| < h / 2 of the square of corners.h,
//       |  \     /  |     which is w / 2 texels wide here. A cut parts them, from the vertex to the middle of
//       |   \   /   |     the tile; beyond the overlap each side has its own sample.
//       |west \ east|
//       |   /   \   |     [PCAWang] 4.1 draws patches at random until the error of every overlap is below
//       |  /     \  |     d_max, and cuts after that. Our copy lacks its equations 3 and 4, so we read: d is
//       | /   .   \ |     the mean squared distance over an overlap's texels, summed over all layers, and of a
//       |/  south  \|     set of samples, one for every colour, the largest over all pairs that can meet.
//       +-----------+     d_max has its own unit here, see DiamondParams.
// clang-format on
//
// Tiles agree across a common side for the same reason as ours: both show the two middle rows of one sample.
// The rows at the border are therefore pinned as in corners.h.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/tiles/index_maps.h"

namespace tessera {

// Two samples over the square at a corner, i along side `out`, j along side `in`, the vertex at (0, 0). One
// texel more than the square is wide both ways, as far as the samples go: what lies there shows unless the
// cut leaves the square.
struct Overlap {
  int side = 0;               // of the square, texels
  int reach = 0;              // texels with |i - j| < reach are free
  std::vector<uint32_t> out;  // [j][i], side + 1 each way; kNoTexel at j = side
  std::vector<uint32_t> in;   // likewise; kNoTexel at i = side

  [[nodiscard]] size_t Index(int i, int j) const { return static_cast<size_t>(j) * (side + 1) + i; }
};

struct OverlapCut {
  std::vector<uint8_t> in_wins;  // [j][i], side x side
  int64_t cost = 0;              // in the units of PairCost
};

// The cheapest path from the vertex to the far corner of the square that never turns back: each step goes one
// texel along i or along j, as dynamic programming finds it. Without that restriction it is Dijkstra's
// algorithm, as in [PCAWang] 4.3; on a plane that is the minimum cut, which is the other function.
OverlapCut CutByPath(const Exemplar& exemplar, const Overlap& overlap);
// The minimum cut: at most as dear.
OverlapCut CutByMinimum(const Exemplar& exemplar, const Overlap& overlap);

// What params.method, one of the two, makes. Samples are drawn params.diamonds.num_draws times at most. The
// strips of the result are the samples, w wide and high. Same seed, same tiles, for any number of threads.
// Errors: as CheckDiamondSizes; CANCELLED. Progress in stages "samples" and "tiles".
absl::StatusOr<IndexMaps> SynthesizeDiamonds(const Exemplar& exemplar, const Arrangement& arrangement,
                                             const SynthesisParams& params, const RunContext& context);

// What the above would refuse beyond what every method does. Errors: INVALID_ARGUMENT (an odd tile size, no
// draws, an error not above 0; reason MATERIAL_TOO_SMALL when a sample does not fit the exemplar).
absl::Status CheckDiamondSizes(int exemplar_width, int exemplar_height, const SynthesisParams& params);

}  // namespace tessera
