// The texels of tiles as sections of a part (FORMAT.md). Private to tile_set_*.cc.
//
// Tiles are made of patches of the exemplar. A patch is named by the texel that would stand at (0, 0) of the
// tile if the patch reached so far; most texels are of the patch of a neighbour.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/codec/container.h"
#include "btf/wang/tile_set.h"

namespace tessera {

// `texels` [tiles][w][w] are labels with their turns (PackTexel), a label a pixel of `grid`.
void AddIndexSections(std::span<const uint32_t> texels, int tile_size, const SourceGrid& grid,
                      Container& container);

// Errors: INVALID_ARGUMENT naming the section.
[[nodiscard]] absl::StatusOr<std::vector<uint32_t>> ReadIndexSections(const Container& container,
                                                                      size_t num_tiles, int tile_size,
                                                                      const SourceGrid& grid);

}  // namespace tessera
