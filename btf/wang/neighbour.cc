#include "btf/wang/neighbour.h"

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"

namespace tessera {

absl::StatusOr<std::vector<std::array<TileNeighbour, 4>>> BuildTileNeighbours(const Dressing& dressing) {
  const std::vector<uint8_t>& turns = dressing.turns;
  if (turns.size() != dressing.mesh.quads.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the dressing has ", turns.size(), " turns for ", dressing.mesh.quads.size(), " quads"));
  }
  for (size_t face = 0; face < turns.size(); ++face) {
    if (turns[face] > 3) {
      return absl::InvalidArgumentError(
          absl::StrCat("quad ", face + 1, ": ", turns[face], " turns, expected 0..3"));
    }
  }
  TESSERA_ASSIGN_OR_RETURN(const QuadAdjacency adjacency, BuildAdjacency(dressing.mesh));
  std::vector<std::array<TileNeighbour, 4>> neighbours(turns.size());
  for (size_t face = 0; face < turns.size(); ++face) {
    for (int k = 0; k < 4; ++k) {
      const QuadAdjacency::Across& across = adjacency.across[face][k];
      if (across.face < 0) {
        continue;
      }
      const int side = (k - turns[face]) & 3;
      const int other_side = (across.side - turns[across.face]) & 3;
      neighbours[face][side] = {across.face, static_cast<uint8_t>(other_side),
                                static_cast<uint8_t>((side + 2 - other_side) & 3)};
    }
  }
  return neighbours;
}

}  // namespace tessera
