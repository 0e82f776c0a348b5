// The settings that an automatic choice looks at: for each codec a ladder from the smallest model to the
// largest.
#pragma once

#include <string>
#include <vector>

#include "btf/codec/codec.h"
#include "btf/data/btf_source.h"

namespace tessera {

struct Setting {
  std::string label;  // "25x25" (light x view coefficients), "c 5", "rank 24"
  EncodeParams params;
  uint64_t code_bytes = 0;  // of all texels: a lower bound on the container
};

// Every rung holds what the one below it does and more, so that errors fall towards the top until a model
// fits noise or has nothing left to add.
struct Ladder {
  std::string codec;
  // The model projects on spherical harmonics of the light, so that an environment is one sum.
  bool projects_on_harmonics = true;
  std::vector<Setting> rungs;  // at least one
  std::vector<size_t> stops;   // rungs that a search climbs by, ascending; the last is the top
};

// dfmf, dsh, dsh-cls and view-pca, in the order in which ties are broken. `params` gives the memory budget
// and the spill folder.
//
//   dfmf            rank 1, 2, 3, 4, then steps of a quarter or less, up to 256
//   dsh, dsh-cls    light x view coefficients 1x1, 4x1, 4x4, 9x4, .. 49x49: one side up, then the other
//   view-pca        c = 1, 2, 3, 4, 5, 6, 8, .. 32 eigen-textures a view, below the number of lights
[[nodiscard]] std::vector<Ladder> ChoiceLadders(const BtfInfo& info, const EncodeParams& params);

}  // namespace tessera
