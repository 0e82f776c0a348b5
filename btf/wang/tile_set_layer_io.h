// A layer of a tile set as sections of a part (FORMAT.md). Private to tile_set_*.cc.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include <absl/status/statusor.h>

#include "btf/codec/container.h"
#include "btf/wang/tile_set_layers.h"

namespace tessera {

// What all layers share; with the first.
void AddSharedSections(const TileSetLayers& layers, Container& container);

// Of layer `index`, with the codes of these of `num_blocks` blocks.
void AddLayerSections(const TileSetLayers& layers, size_t index, std::span<const uint32_t> blocks,
                      size_t num_blocks, Container& container);

// Whether a part has a layer.
[[nodiscard]] bool HasLayer(const Container& container);

// What all layers share, but no layers. `num_coefficients` is k. Errors: INVALID_ARGUMENT naming the section.
[[nodiscard]] absl::StatusOr<TileSetLayers> ReadSharedSections(const Container& container,
                                                               size_t num_coefficients, size_t num_views,
                                                               size_t num_lights);

// The layer that follows those of `sum`, with cores of so many matrices. Errors: INVALID_ARGUMENT naming the
// section.
[[nodiscard]] absl::StatusOr<TileSetLayer> ReadLayerSections(const Container& container, const LayerSum& sum,
                                                             size_t num_matrices);

}  // namespace tessera
