// Re-dressing: binds a tile set to a dressing by a look-up, without tiling or synthesis.
//
//   TESSERA_ASSIGN_OR_RETURN(Binding binding, Redress(dressing, tile_set));
//   const uint32_t texel = binding.texels[quad][y * binding.tile_size + x];
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/wang/dressing.h"
#include "btf/wang/tile_set.h"

namespace tessera {

// What a renderer needs per quad. Borrows from the dressing and the tile set, which must outlive it.
struct Binding {
  const Dressing* dressing = nullptr;
  const TileSet* tile_set = nullptr;
  int tile_size = 0;
  std::vector<const uint32_t*>
      texels;  // [quads], the quad's tile in tile_set->tile_index, [w][w], row 0 on top
};

// Errors: FAILED_PRECONDITION naming both arrangements and both SHA-256 when they differ, or the
// quad whose tile the tile set does not hold (tile_set_parts.h); INVALID_ARGUMENT
// naming the quad when its tile or turn does not exist, or the shapes that disagree.
[[nodiscard]] absl::StatusOr<Binding> Redress(const Dressing& dressing, const TileSet& tile_set);

}  // namespace tessera
