// A layer of a tile set as sections of a part (FORMAT.md). Private to tile_set_*.cc.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/codec/container.h"
#include "btf/wang/tile_set_layers.h"

namespace tessera {

// What of `layer`, the one at `index`, is about these of `num_tiles` tiles (none: all).
void AddLayerSections(const TileSetLayers& layers, size_t index, const std::vector<uint32_t>& tiles,
                      size_t num_tiles, Container& container);

// The layer that follows those of `sum`, which has `num_tiles` tiles. Errors: INVALID_ARGUMENT naming the
// section.
[[nodiscard]] absl::StatusOr<TileSetLayer> ReadLayerSections(const Container& container, const LayerSum& sum);

}  // namespace tessera
