// Coefficients of a tile set as a few images, cosine-transformed by block and quantised in layers: what most
// scenes receive of it (refine/set_layers.h makes it, FORMAT.md describes it). An image has a value at each
// pixel of the exemplar; a block is s x s pixels of it, and only blocks that have BTFels are here.
//
// A coefficient is mean[j] + scale[j] * sum over components c of basis[c][j] * image[c](BTFel). Each layer
// brings components, and makes the images of all that came before finer, and cores of the codec's tables
// (table_cores.h).
//
//   LayerSum sum(BlocksOf(source_pixels, grid, block_side, level), coefficients, mean, scale);
//   TESSERA_RETURN_IF_ERROR(sum.Add(layer));       // again and again
//   std::vector<float> values = sum.Coefficients(btfels);   // [btfels][k]
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <absl/status/status.h>

#include "btf/wang/table_cores.h"
#include "btf/wang/tile_set.h"

namespace tessera {

inline constexpr size_t kMostLayerComponents = 256;
// Components times pixels of blocks: each takes a few numbers in memory.
inline constexpr size_t kMostLayerValues = size_t{1} << 26;

struct TileSetLayer {
  // Of the images' cosine coefficients, times StepFactors.
  float step = 0.0F;  // > 0
  // Of each component that it brings:
  std::vector<float> basis_step;  // >= 0; basis = basis_step * code
  std::vector<int32_t> basis;     // one component after the other, [coefficients] codes
  // Of all components so far, what is added to them: [component][frequency][block] codes, frequencies in
  // BlockFrequencies's order.
  std::vector<int32_t> codes;
  // What is added to the cores: [position][matrix] codes, up to the last that is not 0.
  float core_step = 0.0F;  // > 0 where there are codes
  std::vector<int32_t> cores;
};

struct TileSetLayers {
  int block_side = 1;                  // s
  int level = 0;                       // LayerBlocks's
  std::vector<uint32_t> coefficients;  // that layers make, each once
  std::vector<float> mean;             // [k]
  std::vector<float> scale;            // [k]
  std::optional<CoreBases> bases;      // of AngularTablesOf the tile set, which come as cores, if any do
  std::vector<TileSetLayer> layers;
};

// One cosine: u half periods across the block, v down.
struct BlockFrequency {
  int u = 0;
  int v = 0;
};
// [s * s], by rising u + v, then by rising v.
[[nodiscard]] std::vector<BlockFrequency> BlockFrequencies(int block_side);

// The blocks of an exemplar that some BTFels lie in.
struct LayerBlocks {
  int side = 1;
  int footprint = 1;              // SourceGrid's
  int level = 0;                  // the finest mip level that is seen
  std::vector<uint32_t> numbers;  // of the blocks that are here, ascending: left to right, then down
  std::vector<uint32_t> places;   // [BTFels], pixel of the blocks that are here, (block * s + y) * s + x

  [[nodiscard]] size_t size() const { return numbers.size(); }
  [[nodiscard]] size_t num_pixels() const { return numbers.size() * side * side; }
  // What a layer's step is multiplied by for each of BlockFrequencies: the footprint, since frequencies above
  // the BTFels' own have nothing to say, over what is seen of the frequency (at least kLeastSeen): texels of
  // the level are means of BTFels, and are seen blended with the next level's, by one half in the mean.
  [[nodiscard]] std::vector<float> StepFactors() const;
};
inline constexpr double kLeastSeen = 0.125;
// Of BTFels at these pixels, y * width + x.
[[nodiscard]] LayerBlocks BlocksOf(std::span<const uint32_t> pixels, const SourceGrid& grid, int side,
                                   int level);

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
  // `mean` and `scale` are [k], finite; coefficients are below k.
  LayerSum(LayerBlocks blocks, std::vector<uint32_t> coefficients, std::vector<float> mean,
           std::vector<float> scale);

  [[nodiscard]] size_t num_components() const { return basis_.size(); }
  [[nodiscard]] const LayerBlocks& blocks() const { return blocks_; }
  [[nodiscard]] std::span<const uint32_t> coefficients() const { return coefficients_; }
  // Of a component, [frequency][block].
  [[nodiscard]] std::span<const float> cosines(size_t component) const { return cosines_[component]; }

  // After an error it is what it was before. Errors: INVALID_ARGUMENT naming the member, its value and the
  // limit.
  [[nodiscard]] absl::Status Add(const TileSetLayer& layer);
  // No coefficient is larger than this.
  [[nodiscard]] float Bound() const;
  // [rows][k], of the means of so many BTFels that follow each other. Finite where Bound() is.
  [[nodiscard]] std::vector<float> Coefficients(std::span<const uint32_t> btfels, size_t per_row = 1) const;

 private:
  [[nodiscard]] absl::Status Check(const TileSetLayer& layer) const;

  LayerBlocks blocks_;
  std::vector<uint32_t> coefficients_;
  std::vector<float> mean_;
  std::vector<float> scale_;
  std::vector<float> factors_;  // [frequency]
  BlockCosines transform_;
  std::vector<std::vector<float>> basis_;    // [component][coefficients], scaled
  std::vector<std::vector<float>> cosines_;  // [component][frequency][block]
  std::vector<std::vector<float>> images_;   // [component][block][y][x]
};

}  // namespace tessera
