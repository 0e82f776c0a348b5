#include "btf/wang/redress.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

#include "btf/wang/tile_set_parts.h"

namespace tessera {

absl::StatusOr<Binding> Redress(const Dressing& dressing, const TileSet& tile_set) {
  if (dressing.arrangement_id != tile_set.arrangement_id ||
      dressing.arrangement_sha256 != tile_set.arrangement_sha256) {
    return absl::FailedPreconditionError(
        absl::StrCat("arrangements differ: the dressing has ", dressing.arrangement_id, " (sha256 ",
                     dressing.arrangement_sha256, "), the tile set ", tile_set.arrangement_id, " (sha256 ",
                     tile_set.arrangement_sha256, ")"));
  }
  const size_t num_quads = dressing.mesh.quads.size();
  if (dressing.tile.size() != num_quads || dressing.turns.size() != num_quads) {
    return absl::InvalidArgumentError(absl::StrCat("the dressing has ", dressing.tile.size(), " tiles and ",
                                                   dressing.turns.size(), " turns for ", num_quads,
                                                   " quads"));
  }
  const size_t num_tiles = tile_set.tile_codes.size();
  const auto tile_size = static_cast<size_t>(tile_set.tile_size > 0 ? tile_set.tile_size : 0);
  const size_t texels_per_tile = tile_size * tile_size;
  if (texels_per_tile == 0 || tile_set.tile_index.size() != num_tiles * texels_per_tile) {
    return absl::InvalidArgumentError(absl::StrCat("the tile set has ", tile_set.tile_index.size(),
                                                   " texels for ", num_tiles, " tiles of ",
                                                   tile_set.tile_size, "x", tile_set.tile_size));
  }
  const std::optional<std::vector<uint32_t>> held = TilesHeld(tile_set);
  Binding binding{
      .dressing = &dressing, .tile_set = &tile_set, .tile_size = tile_set.tile_size, .texels = {}};
  binding.texels.resize(num_quads);
  for (size_t quad = 0; quad < num_quads; ++quad) {
    const size_t tile = dressing.tile[quad];
    if (tile >= num_tiles || dressing.turns[quad] > 3) {
      return absl::InvalidArgumentError(absl::StrCat("quad ", quad + 1, ": tile ", tile, " with ",
                                                     dressing.turns[quad], " turns; the tile set has ",
                                                     num_tiles, " tiles and turns are 0..3"));
    }
    if (held.has_value() && !std::ranges::binary_search(*held, tile)) {
      return absl::FailedPreconditionError(
          absl::StrCat("quad ", quad + 1, " shows tile ", tile, ", which is not among the ", held->size(),
                       " of ", num_tiles, " tiles that this part of a tile set holds"));
    }
    binding.texels[quad] = tile_set.tile_index.data() + tile * texels_per_tile;
  }
  return binding;
}

}  // namespace tessera
