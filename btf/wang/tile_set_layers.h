// Coefficients of a tile set as a few images, cosine-transformed by block and quantised in layers: what most
// scenes receive of it (refine/set_layers.h makes it, FORMAT.md describes it). A block is s x s BTFels that
// follow each other: of a mip level, whose texels are BTFels of their own, a tile; of other sets one BTFel.
//
// A coefficient is mean[j] + scale[j] * sum over components c of its layer of basis[c][j] * image[c](BTFel):
// one layer brought it, and components are made of the coefficients of one layer. Each layer brings
// components, and makes the images of all that came before finer.
//
//   LayerSum sum(block_side, num_blocks, mean, scale);
//   TESSERA_RETURN_IF_ERROR(sum.Add(layer));       // again and again
//   std::vector<float> values = sum.Coefficients(btfels);   // [btfels][k]
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <absl/status/status.h>

#include "btf/codec/btfel_table.h"

namespace tessera {

inline constexpr size_t kMostLayerComponents = 256;
// Components times BTFels: each takes a few numbers in memory.
inline constexpr size_t kMostLayerValues = size_t{1} << 26;

struct TileSetLayer {
  // Of the images' cosine coefficients; twice as long for those of the upper half of the frequencies across
  // or down.
  float step = 0.0F;                   // > 0
  std::vector<uint32_t> coefficients;  // that it brings
  // Of each component that it brings:
  std::vector<uint32_t> spans;    // the layer whose coefficients it is made of, this or one before
  std::vector<float> basis_step;  // >= 0; basis = basis_step * code
  std::vector<int32_t> basis;     // one component after the other, [coefficients of its layer] codes
  // Of all components so far, what is added to them: [component][frequency][block] codes, frequencies in
  // BlockFrequencies's order.
  std::vector<int32_t> codes;
};

struct TileSetLayers {
  int block_side = 1;        // s
  std::vector<float> mean;   // [k], of coefficients that no layer has brought
  std::vector<float> scale;  // [k]
  std::vector<TileSetLayer> layers;
  // In place of the tile set's of these names: entries that belong to single coefficients, rounded.
  std::map<std::string, CodecTable> tables;
};

// One cosine: u half periods across the block, v down.
struct BlockFrequency {
  int u = 0;
  int v = 0;
};
// [s * s], by rising u + v, then by rising v.
[[nodiscard]] std::vector<BlockFrequency> BlockFrequencies(int block_side);
// What a layer's step is multiplied by: 2 in the upper half, which the next level does not have, else 1. A
// level is seen blended with the next one, by one half in the mean.
[[nodiscard]] float StepFactor(const BlockFrequency& frequency, int block_side);

// Orthonormal DCT-II of the blocks of an image, [block][y][x] to [frequency][block], and back. Of blocks of
// one, the same image.
class BlockCosines {
 public:
  explicit BlockCosines(int block_side);
  [[nodiscard]] std::vector<float> Forward(std::span<const float> image) const;
  [[nodiscard]] std::vector<float> Back(std::span<const float> cosines) const;

 private:
  int side_;
  std::vector<float> matrix_;  // [u][x]
  std::vector<BlockFrequency> frequencies_;
};

// Layers, added up. Not thread-safe.
class LayerSum {
 public:
  // `mean` and `scale` are [k], finite.
  LayerSum(int block_side, size_t num_blocks, std::vector<float> mean, std::vector<float> scale);

  [[nodiscard]] size_t num_layers() const { return coefficients_.size(); }
  [[nodiscard]] size_t num_components() const { return spans_.size(); }
  [[nodiscard]] size_t num_blocks() const { return num_blocks_; }
  [[nodiscard]] size_t num_btfels() const { return num_blocks_ * frequencies_.size(); }
  // Those that a layer brought.
  [[nodiscard]] std::span<const uint32_t> coefficients(size_t layer) const { return coefficients_[layer]; }
  // Of a component, [frequency][block].
  [[nodiscard]] std::span<const float> cosines(size_t component) const { return cosines_[component]; }

  // After an error it is what it was before. Errors: INVALID_ARGUMENT naming the member, its value and the
  // limit.
  [[nodiscard]] absl::Status Add(const TileSetLayer& layer);
  // No coefficient is larger than this.
  [[nodiscard]] float Bound() const;
  // [btfels][k]. Finite where Bound() is.
  [[nodiscard]] std::vector<float> Coefficients(std::span<const uint32_t> btfels) const;

 private:
  [[nodiscard]] absl::Status Check(const TileSetLayer& layer) const;

  int block_side_;
  size_t num_blocks_;
  std::vector<float> mean_;
  std::vector<float> scale_;
  std::vector<BlockFrequency> frequencies_;
  BlockCosines transform_;
  std::vector<std::vector<uint32_t>> coefficients_;  // [layer]
  std::vector<uint32_t> spans_;                      // [component]
  std::vector<std::vector<float>> basis_;            // [component][coefficients of its layer], scaled
  std::vector<std::vector<float>> cosines_;          // [component][frequency][block]
  std::vector<std::vector<float>> images_;           // [component][block][y][x]
};

}  // namespace tessera
