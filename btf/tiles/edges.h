// Step 2 of synthesis: strips. The two corner samples stand at the ends; the (w - h) x h between them is
// filled.
//
// Every tile shows strips on all its sides, and what two tiles show across a border nothing can mend later.
// There are few strips, so each is made several times, for each of the cheapest sets of corner samples, and
// the set is kept whose corners and best strips cost least together.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/tiles/controls.h"
#include "btf/tiles/corners.h"
#include "btf/tiles/filler.h"

namespace tessera {

struct Strip {
  int width = 0;                 // w
  int height = 0;                // h
  std::vector<uint32_t> texels;  // [h][w]
  int64_t cost = 0;              // of its seams (PairCost), more for those that borders of tiles cross
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

// Corner samples and the strips between them.
struct Edges {
  Corners corners;
  std::vector<Strip> strips;  // by strip
};

// From one of the cheapest of `corner_sets`, which are at least one, cheapest first. `params` are those of
// all strips, but for the turns. Progress in stage "strips". Errors: CANCELLED.
absl::StatusOr<Edges> SynthesizeEdges(const ExemplarSpectra& spectra, const Arrangement& arrangement,
                                      const std::vector<Corners>& corner_sets, const Controls& controls,
                                      int tile_size, const FillParams& params, const RunContext& context);

}  // namespace tessera
