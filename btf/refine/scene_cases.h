// Lights and views over which what a tile set lacks is measured, as weights of its coefficients.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "btf/codec/btfel_table.h"
#include "btf/codec/decoder.h"
#include "btf/codec/scene_light.h"

namespace tessera {

using FloatRows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

inline constexpr int kRefineViews = 96;
// BTFels over which errors are measured.
inline constexpr size_t kRefineBtfels = 1024;
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

// [btfels][k] of these BTFels of the table.
[[nodiscard]] FloatRows CoefficientsOf(const BtfelTable& table, const std::vector<size_t>& btfels);

// RMSE of what texels reflect, both clamped at 0.
[[nodiscard]] double RmseOf(const FloatRows& values, const FloatRows& whole);

}  // namespace tessera
