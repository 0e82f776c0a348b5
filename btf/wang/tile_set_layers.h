// Coefficients of a tile set as a few images, cosine-transformed tile by tile and quantised in layers: what
// scenes that are far away receive (refine/level_layers.h makes it, FORMAT.md describes it).
//
// A coefficient is mean[j] + scale[j] * sum over components c of its layer of basis[c][j] * image[c](texel):
// one layer brought it, and components are made of the coefficients of one layer. Each layer brings
// components, and makes the images of all that came before finer.
//
//   LayerSum sum(tile_size, num_tiles, mean, scale);
//   TESSERA_RETURN_IF_ERROR(sum.Add(layer));       // again and again
//   FloatRows values = sum.Coefficients(texels);   // [texels][k]
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <Eigen/Core>

#include "btf/codec/btfel_table.h"

namespace tessera {

inline constexpr size_t kMostLayerComponents = 256;

using FloatRows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct TileSetLayer {
  // Of the images' cosine coefficients; twice as long for those of the upper half of the frequencies across
  // or down.
  float step = 0.0F;                   // > 0
  std::vector<uint32_t> coefficients;  // that it brings
  // Of each component that it brings:
  std::vector<uint32_t> spans;    // the layer whose coefficients it is made of, this or one before
  std::vector<float> basis_step;  // >= 0; basis = basis_step * code
  std::vector<int32_t> basis;     // one component after the other, [coefficients of its layer] codes
  // Of all components so far, what is added to them: [component][frequency][tile] codes, frequencies in
  // TileFrequencies's order.
  std::vector<int32_t> codes;
};

struct TileSetLayers {
  std::vector<float> mean;   // [k], of coefficients that no layer has brought
  std::vector<float> scale;  // [k]
  std::vector<TileSetLayer> layers;
  // In place of the tile set's of these names: entries that belong to single coefficients, rounded.
  std::map<std::string, CodecTable> tables;
};

// One cosine: u half periods across the tile, v down.
struct TileFrequency {
  int u = 0;
  int v = 0;
};
// [w * w], by rising u + v, then by rising v.
[[nodiscard]] std::vector<TileFrequency> TileFrequencies(int tile_size);
// What a layer's step is multiplied by: 2 in the upper half, which the next level does not have, else 1. A
// level is seen blended with the next one, by one half in the mean.
[[nodiscard]] float StepFactor(const TileFrequency& frequency, int tile_size);

// Orthonormal DCT-II of a tile's texels [w][w] to [v][u], and back.
class TileCosines {
 public:
  explicit TileCosines(int tile_size);
  [[nodiscard]] FloatRows Forward(const FloatRows& texels) const {
    return matrix_ * texels * matrix_.transpose();
  }
  [[nodiscard]] FloatRows Back(const FloatRows& cosines) const {
    return matrix_.transpose() * cosines * matrix_;
  }

 private:
  FloatRows matrix_;
};

// Layers, added up. Not thread-safe.
class LayerSum {
 public:
  // `mean` and `scale` are [k], finite.
  LayerSum(int tile_size, size_t num_tiles, std::vector<float> mean, std::vector<float> scale);

  [[nodiscard]] size_t num_layers() const { return coefficients_.size(); }
  [[nodiscard]] size_t num_components() const { return spans_.size(); }
  [[nodiscard]] size_t num_tiles() const { return num_tiles_; }
  [[nodiscard]] size_t num_texels() const { return num_tiles_ * frequencies_.size(); }
  // Those that a layer brought.
  [[nodiscard]] std::span<const uint32_t> coefficients(size_t layer) const { return coefficients_[layer]; }
  // Of a component, [frequency][tile].
  [[nodiscard]] std::span<const float> cosines(size_t component) const { return cosines_[component]; }

  // After an error it is what it was before. Errors: INVALID_ARGUMENT naming the member, its value and the
  // limit.
  [[nodiscard]] absl::Status Add(const TileSetLayer& layer);
  // [texels][k]; texels count [tile][y][x]. Finite where what was added was not beyond all measure.
  [[nodiscard]] FloatRows Coefficients(std::span<const uint32_t> texels) const;

 private:
  [[nodiscard]] absl::Status Check(const TileSetLayer& layer) const;

  int tile_size_;
  size_t num_tiles_;
  std::vector<float> mean_;
  std::vector<float> scale_;
  std::vector<TileFrequency> frequencies_;
  TileCosines transform_;
  std::vector<std::vector<uint32_t>> coefficients_;  // [layer]
  std::vector<uint32_t> spans_;                      // [component]
  std::vector<std::vector<float>> basis_;            // [component][coefficients of its layer], scaled
  std::vector<std::vector<float>> cosines_;          // [component][frequency][tile]
  std::vector<std::vector<float>> images_;           // [component][tile][y][x]
};

}  // namespace tessera
