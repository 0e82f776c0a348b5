// Step 2 of synthesis: strips. The two corner samples stand at the ends; the (w - h) x h between them is
// filled.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/status.h>

#include "btf/tiles/controls.h"
#include "btf/tiles/corners.h"
#include "btf/tiles/filler.h"

namespace tessera {

struct Strip {
  int width = 0;                 // w
  int height = 0;                // h
  std::vector<uint32_t> texels;  // [h][w]
  FillReport report;

  [[nodiscard]] uint32_t texel(int x, int y) const { return texels[static_cast<size_t>(y) * width + x]; }
};

// The samples first bring along what surrounds them in the exemplar, so that the first seam is free to run
// where it is cheapest; so do placed features, whose texels stay; then the filler fills what is left and
// improves. params.turns are those of the strip. Errors: CANCELLED. Whether the thresholds were reached is in
// strip.report.
absl::Status SynthesizeStrip(const ExemplarSpectra& spectra, const Corners& corners,
                             const std::vector<PlacedFeature>& placed, int strip_index, int tile_size,
                             const FillParams& params, const RunContext& context, Strip& strip);

}  // namespace tessera
