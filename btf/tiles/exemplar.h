// The exemplar as synthesis sees it: texels with a turn as points of the embedding, and who lies beside whom.
//
// A texel is written as in a tile index: PackTexel(pixel, turns) with pixel = y * width + x of the unturned
// exemplar. The exemplar turned by t is a picture of its own, of size TurnedSize(t); a patch is a rectangle
// of it.
//
//   uint32_t a = exemplar.TexelAt(/*turn=*/1, u, v);
//   uint32_t right_of_a = exemplar.Step(a, GridCut::kRight);   // kNoTexel off the exemplar
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "btf/codec/codec.h"
#include "btf/tiles/max_flow.h"
#include "btf/wang/tile_set.h"

namespace tessera {

inline constexpr uint32_t kNoTexel = 0xffffffffu;

// Dimensions of the embedding: the prefix that ranks candidates, and all that cuts and thresholds see.
inline constexpr int kSearchDims = 16;
inline constexpr int kCutDims = 32;

// What a seam costs, from the mismatch of its patches and their own steps there (seam_graph.h), and the
// embedding that SynthesizeTileSet lays tiles in.
enum class SeamRule {
  kMismatch,  // [Leung2007], [Kwatra2003]: the mismatch; in the codec's embedding
  // What the seam's step exceeds those by: hidden where the material itself changes; in seam_embedding.h.
  kExcess
};

// `texel` seen after `turns` more quarter turns.
constexpr uint32_t TurnTexel(uint32_t texel, int turns) {
  return texel == kNoTexel ? kNoTexel : PackTexel(BtfelOfTexel(texel), TurnsOfTexel(texel) + turns);
}

class Exemplar {
 public:
  // Takes the first `cut_dims` dimensions, at least 1; an embedding may have fewer.
  explicit Exemplar(const Embedding& embedding, SeamRule seam_rule = SeamRule::kExcess,
                    int cut_dims = kCutDims);

  [[nodiscard]] SeamRule seam_rule() const { return seam_rule_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] int num_pixels() const { return width_ * height_; }
  [[nodiscard]] int TurnedWidth(int turn) const { return (turn & 1) == 0 ? width_ : height_; }
  [[nodiscard]] int TurnedHeight(int turn) const { return (turn & 1) == 0 ? height_ : width_; }

  // The texel at column u, row v of the exemplar turned by `turn`.
  [[nodiscard]] uint32_t TexelAt(int turn, int u, int v) const;
  // The inverse: column and row in the exemplar turned by TurnsOfTexel(texel).
  [[nodiscard]] std::array<int, 2> TurnedPosition(uint32_t texel) const;
  // The texel `dx` columns right and `dy` rows down of `texel` in its turned exemplar, kNoTexel off it.
  [[nodiscard]] uint32_t Shift(uint32_t texel, int dx, int dy) const;
  // The texel beside it in a GridCut::Direction. Directions count counter-clockwise, as turns do.
  [[nodiscard]] uint32_t Step(uint32_t texel, int direction) const {
    const int turns = TurnsOfTexel(texel);
    const uint32_t pixel =
        beside_[static_cast<size_t>((direction - turns) & 3) * num_pixels() + BtfelOfTexel(texel)];
    return pixel == kNoTexel ? kNoTexel : PackTexel(pixel, turns);
  }

  // Number of floats of a point, a multiple of 8; those past the embedding's dimensions are 0.
  [[nodiscard]] int dims() const { return dims_; }
  [[nodiscard]] int search_dims() const { return search_dims_; }
  [[nodiscard]] const float* Point(uint32_t texel) const {
    return values_.data() +
           (static_cast<size_t>(TurnsOfTexel(texel)) * num_pixels() + BtfelOfTexel(texel)) * dims_;
  }
  [[nodiscard]] float Distance(uint32_t a, uint32_t b) const {
    const float* const p = Point(a);
    const float* const q = Point(b);
    float lanes[kLane] = {};
    for (int i = 0; i < dims_; i += kLane) {
      for (int j = 0; j < kLane; ++j) {
        const float difference = p[i + j] - q[i + j];
        lanes[j] += difference * difference;
      }
    }
    return std::sqrt(((lanes[0] + lanes[4]) + (lanes[1] + lanes[5])) +
                     ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7])));
  }
  // Of a texel and the one beside it in a GridCut::Direction, from a table; 0 off the exemplar.
  [[nodiscard]] float StepLength(uint32_t texel, int direction) const {
    return step_lengths_[(static_cast<size_t>(TurnsOfTexel(texel)) * 4 + direction) * num_pixels() +
                         BtfelOfTexel(texel)];
  }

  // What mismatches are measured in: the mean distance of neighbours, and the root mean square distance of
  // two texels drawn at random.
  [[nodiscard]] double mean_step() const { return mean_step_; }
  [[nodiscard]] double mean_steps_per_unit() const { return mean_steps_per_unit_; }
  [[nodiscard]] double spread() const { return spread_; }
  // Over all texels in all turns, [dims].
  [[nodiscard]] const std::vector<double>& mean() const { return mean_; }
  // Mean squared distance, in the search dimensions, of two texels drawn at random.
  [[nodiscard]] double search_spread() const { return search_spread_; }

 private:
  static constexpr int kLane = 8;  // floats of an AVX register

  SeamRule seam_rule_;
  int width_ = 0;
  int height_ = 0;
  int dims_ = 0;
  int search_dims_ = 0;
  double mean_step_ = 0.0;
  double mean_steps_per_unit_ = 0.0;
  double spread_ = 0.0;
  double search_spread_ = 0.0;
  std::vector<double> mean_;
  std::vector<float> values_;        // [turn][pixel][dims]
  std::vector<uint32_t> beside_;     // [direction][pixel] of the unturned exemplar, kNoTexel off it
  std::vector<float> step_lengths_;  // [turn][direction][pixel]
};

}  // namespace tessera
