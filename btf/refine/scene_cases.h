// Lights and views over which what a tile set lacks is measured, as weights of its coefficients.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "btf/codec/btfel_table.h"
#include "btf/codec/decoder.h"
#include "btf/codec/scene_light.h"
#include "btf/wang/tile_set.h"

namespace tessera {

using FloatRows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

inline constexpr int kRefineViews = 96;
// Texels over which errors are measured.
inline constexpr size_t kRefineTexels = 1024;
inline constexpr int kRefineLights = 2;

// values * weights^T is what texels with these coefficients [texels][k] reflect, before it is clamped at 0.
struct SceneCases {
  FloatRows weights;       // [3 * cases][k], a row for each channel of each case
  std::string directions;  // the cases, in words
};

// Of the table's own frame:
//   point        each measured view, at most kRefineViews spread over them, with some measured lights each;
//   environment  these views in five soft lights of irradiance pi, each the shape of a cosine lobe up to
//                degree 2: from above, and from 45 degrees at four azimuths.
[[nodiscard]] SceneCases MakeSceneCases(const Decoder& decoder, const BtfelTable& table, SceneLight light,
                                        int lights_per_view = kRefineLights);

// At most `most` of the numbers below `count`, evenly spread, ascending.
[[nodiscard]] std::vector<size_t> Spread(size_t count, size_t most);

// As many, in steps of the golden section: where numbers are texels of tiles, even steps would take the same
// few columns of all of them.
[[nodiscard]] std::vector<size_t> Scatter(size_t count, size_t most);

// At most kRefineTexels texels of a mip level, spread over the tiles, each the mean of per_row BTFels. Each
// BTFel in its own frame, so that what is measured does not depend on turns.
struct SampledTexels {
  std::vector<uint32_t> btfels;  // [texels][per_row]
  size_t per_row = 1;
};
// Of a tile set, level 0, or of one that MakeLevelSet made. The level is one that its tiles have.
[[nodiscard]] SampledTexels SampleTexels(const TileSet& tile_set, int level);

// [rows][k], of the means of so many BTFels that follow each other.
[[nodiscard]] FloatRows CoefficientsOf(const BtfelTable& table, std::span<const uint32_t> btfels,
                                       size_t per_row = 1);

// RMSE of what texels reflect, both clamped at 0.
[[nodiscard]] double RmseOf(const FloatRows& values, const FloatRows& whole);

}  // namespace tessera
