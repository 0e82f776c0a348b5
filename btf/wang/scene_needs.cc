#include "btf/wang/scene_needs.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <absl/strings/str_cat.h>

#include "btf/base/reason.h"

namespace tessera {
namespace {

absl::Status RefuseNeed(const std::string& message, std::string_view field) {
  return WithReason(absl::InvalidArgumentError(message), "ARGUMENT_INVALID", field);
}

}  // namespace

int LastMipLevel(int tile_size) {
  int level = 0;
  for (; tile_size > 1 && tile_size % 2 == 0; tile_size /= 2) {
    ++level;
  }
  return level;
}

absl::Status CheckNeeds(const SceneNeeds& needs, size_t num_tiles, int tile_size) {
  for (const uint32_t tile : needs.tiles) {
    if (tile >= num_tiles) {
      return RefuseNeed(absl::StrCat("tile ", tile, ": the tile set has tiles 0 to ", num_tiles - 1),
                        "tiles");
    }
  }
  if (const int last = LastMipLevel(tile_size); needs.level < 0 || needs.level > last) {
    return RefuseNeed(absl::StrCat("level ", needs.level, ": tiles of ", tile_size, "x", tile_size,
                                   " texels have levels 0 to ", last),
                      "level");
  }
  if (needs.max_error.has_value() && !(*needs.max_error >= 0.0 && std::isfinite(*needs.max_error))) {
    return RefuseNeed(absl::StrCat("max_error ", *needs.max_error, ", expected a finite number from 0"),
                      "max_error");
  }
  if (needs.max_bytes == uint64_t{0}) {
    return RefuseNeed("max_bytes 0, expected at least 1", "max_bytes");
  }
  return absl::OkStatus();
}

SceneNeeds NeedsOfDressing(const Dressing& dressing) {
  SceneNeeds needs;
  needs.tiles = dressing.tile;
  std::ranges::sort(needs.tiles);
  needs.tiles.erase(std::ranges::unique(needs.tiles).begin(), needs.tiles.end());
  return needs;
}

absl::StatusOr<int> LevelForPixels(int tile_size, double pixels_per_quad) {
  if (!(pixels_per_quad > 0.0 && std::isfinite(pixels_per_quad))) {
    return RefuseNeed(absl::StrCat("pixels per quad ", pixels_per_quad, ", expected a number above 0"),
                      "pixels_per_quad");
  }
  const double level = std::floor(std::log2(tile_size / pixels_per_quad) - kLevelBias);
  return static_cast<int>(std::clamp(level, 0.0, static_cast<double>(LastMipLevel(tile_size))));
}

}  // namespace tessera
