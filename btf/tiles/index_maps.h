// Synthesis by any method on an embedding, before any codec is looked at: the tiles as maps of exemplar
// texels.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/tiles/controls.h"
#include "btf/tiles/edges.h"
#include "btf/tiles/synthesize.h"

namespace tessera {

// How the samples of diamonds were found; as it stands for kFrame.
struct DiamondReport {
  int num_draws = 0;           // sets of samples drawn
  double overlap_error = 0.0;  // of the set taken, as DiamondParams::largest_error
  bool accepted = false;       // below it
};

struct IndexMaps {
  int tile_size = 0;
  std::vector<uint32_t> texels;  // [tiles][w][w], PackTexel(exemplar pixel, turns)
  std::vector<Strip> strips;
  int64_t corner_cost = 0;   // of all cuts of step 1, in the units of PairCost
  int64_t corner_seams = 0;  // how many cuts those are
  std::vector<FillReport> tile_reports;
  DiamondReport diamonds;

  [[nodiscard]] uint32_t texel(int tile, int x, int y) const {
    return texels[(static_cast<size_t>(tile) * tile_size + y) * tile_size + x];
  }
};

// Errors: INVALID_ARGUMENT (sizes; reason MATERIAL_TOO_SMALL when the exemplar is the cause),
// FAILED_PRECONDITION with reason THRESHOLD_NOT_REACHED naming the worst strip or tile and its figures,
// CANCELLED. Anisotropy and params.recipe are not looked at: `controls` are what the recipe says, for this
// exemplar, arrangement and sizes; diamonds take none. Where they exclude so much that no patch is left:
// INVALID_ARGUMENT.
absl::StatusOr<IndexMaps> SynthesizeIndexMaps(const Exemplar& exemplar, const Arrangement& arrangement,
                                              const SynthesisParams& params, const RunContext& context,
                                              const Controls& controls = {});

// The tiles as BTFels of `material`, whose embedding they were made in: all of a tile set but its metadata
// and certificate.
TileSet TileSetOfMaps(const Material& material, const Arrangement& arrangement, const IndexMaps& maps,
                      const SynthesisParams& params);

// The sizes alone: what the above would refuse. Errors as above.
absl::Status CheckSizes(int exemplar_width, int exemplar_height, const SynthesisParams& params);

}  // namespace tessera
