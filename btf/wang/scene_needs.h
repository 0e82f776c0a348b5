// What a scene shows of a tile set, so that nothing else is sent: tiles, mip level, accuracy.
//
//   SceneNeeds needs = NeedsOfDressing(dressing);
//   needs.level = LevelForPixels(/*tile_size=*/64, /*pixels_per_quad=*/8.0);  // 2
//   TESSERA_RETURN_IF_ERROR(CheckNeeds(needs, num_tiles, tile_size));
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/codec/scene_light.h"
#include "btf/wang/dressing.h"

namespace tessera {

struct SceneNeeds {
  std::vector<uint32_t> tiles;  // indices into the arrangement's list; none: all
  int level = 0;                // the finest mip level that it shows; 0: the tile set itself
  // RMSE against all coefficients of the level, in reflectance, over directions that the plan states: the
  // fewest coefficients that meet it. 0 asks for all.
  std::optional<double> max_error;
  // Of all parts together: as many as fit.
  std::optional<uint64_t> max_bytes;
  SceneLight light = SceneLight::kPoint;  // what errors and order are about
};

// Errors: INVALID_ARGUMENT with the field's name as subject, its value and the limit.
[[nodiscard]] absl::Status CheckNeeds(const SceneNeeds& needs, size_t num_tiles, int tile_size);

// The tiles of the dressing, ascending, each once.
[[nodiscard]] SceneNeeds NeedsOfDressing(const Dressing& dressing);

// Renderers blend levels about log2(texels a pixel's side) - kLevelBias (render/preview_scene.h: kMipBias).
inline constexpr double kLevelBias = 0.5;

// The coarsest level from which quads that are at most `pixels_per_quad` pixels wide look as from all levels:
// the whole part of log2(tile_size / pixels_per_quad) - kLevelBias, from 0 to the last level that the tile
// size allows. Errors: INVALID_ARGUMENT when the pixels are not finite or not above 0.
[[nodiscard]] absl::StatusOr<int> LevelForPixels(int tile_size, double pixels_per_quad);

// How many times a tile's side can be halved.
[[nodiscard]] int LastMipLevel(int tile_size);

}  // namespace tessera
