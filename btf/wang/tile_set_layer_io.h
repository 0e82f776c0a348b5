// A layer of a tile set as sections of a part (FORMAT.md). Private to tile_set_*.cc.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include <absl/status/statusor.h>

#include "btf/codec/container.h"
#include "btf/wang/tile_set_layers.h"

namespace tessera {

// Of layer `index`, with the codes of these of `num_blocks` blocks.
void AddLayerSections(const TileSetLayers& layers, size_t index, std::span<const uint32_t> blocks,
                      size_t num_blocks, Container& container);

// The layer that follows those of `sum`. Errors: INVALID_ARGUMENT naming the
// section.
[[nodiscard]] absl::StatusOr<TileSetLayer> ReadLayerSections(const Container& container, const LayerSum& sum);

}  // namespace tessera
