// Step 4 of synthesis: the inside of a tile, filled within its frame.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <absl/status/status.h>

#include "btf/tiles/controls.h"
#include "btf/tiles/filler.h"

namespace tessera {

// Fills `texels`, [size][size] with kNoTexel where empty. Frame texels may be replaced, those of the border
// row not: they must agree with the neighbouring tile. Placed features stay, and bring along what surrounds
// them in the exemplar. Errors: CANCELLED.
absl::Status LayInterior(const Exemplar& exemplar, int size, const std::vector<PlacedFeature>& placed,
                         const FillParams& params, const RunContext& context, Filler& filler,
                         std::span<uint32_t> texels, FillReport& report);

// Improves the seams of a laid tile, under the same rules. Errors: CANCELLED.
absl::Status ImproveInterior(const Exemplar& exemplar, int size, const std::vector<PlacedFeature>& placed,
                             const FillParams& params, const RunContext& context, Filler& filler,
                             std::span<uint32_t> texels, FillReport& report);

}  // namespace tessera
