// Smaller "dfmf" models out of a larger one: components come in order of what they add, so that one
// factorisation serves every rank below its own.
//
//   BtfelTable small = DfmfPrefix(material.btfels, DfmfSplit(material.btfels, 16), texels);
#pragma once

#include <cstddef>
#include <span>

#include "btf/codec/btfel_table.h"

namespace tessera {

// How many components of luminance and of chrominance.
struct DfmfRanks {
  int luma = 1;
  int chroma = 0;
};

// The split of `rank` components, 1 or more (all where there are fewer), by what each removes of the squared
// error over what it adds to the container, as the encoder splits them (codec/dfmf/angular_factors.h); what
// storing the angular factors costs in accuracy, which changes no more than the last of them, is left out.
// `table` is one that the encoder made.
[[nodiscard]] DfmfRanks DfmfSplit(const BtfelTable& table, int rank);

// The first components of `table`, for the texels of those indices alone. `ranks` are no larger than its own.
[[nodiscard]] BtfelTable DfmfPrefix(const BtfelTable& table, const DfmfRanks& ranks,
                                    std::span<const size_t> texels);

}  // namespace tessera
