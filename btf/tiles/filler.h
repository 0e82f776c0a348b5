// Fills a canvas with patches of the exemplar by iterated cuts and improves it until its seams are good
// enough [Kwatra2003], [Leung2007] 3.2 step 2.
//
// First windows of two and a half features are laid where most is still empty and enough is known around;
// then smaller ones centred on bad seams (drawn in proportion to the square of their cost, those less that
// were tried in vain) are matched again, and every patch is kept that makes the canvas cheaper, until its
// seams show hardly more than the material's own steps. Old seams take part in every cut (seam_graph.h). An
// unfilled texel counts as infinitely wrong, so a canvas is never accepted with one.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/status.h>

#include "btf/base/run_context.h"
#include "btf/tiles/candidates.h"
#include "btf/tiles/controls.h"
#include "btf/tiles/seam_graph.h"
#include "btf/tiles/siblings.h"

namespace tessera {

struct FillParams {
  std::vector<int> turns;  // that patches may have
  int feature_size = 16;   // h: windows are half to two and a half of it
  uint64_t seed = 1;
  double mean_threshold = 0.0;         // of FillReport.mean_mismatch
  double texel_threshold = 0.0;        // of FillReport.largest_mismatch
  int num_candidates = 16;             // SynthesisParams::num_candidates
  int effort = 1;                      // SynthesisParams::effort
  const UsageMap* usage = nullptr;     // makes places used often dearer
  const Siblings* siblings = nullptr;  // patches that repeat one are laid only where no other was found
};

struct FillReport {
  double mean_mismatch = 0.0;     // over the seams, in mean steps of the exemplar
  double largest_mismatch = 0.0;  // of one seam pair, in spreads of the exemplar
  double step_ratio = 0.0;        // of the steps across seams to those that the patches have there
  bool reached = false;           // both at most their thresholds
  int64_t num_truncated = 0;      // pairs of kept patches whose table was not submodular
  int num_patches = 0;            // tried
  int num_kept = 0;
};

// Texels on a side of the windows laid first, unless the canvas is smaller.
int FirstWindowSide(const ExemplarSpectra& spectra, int feature_size);

// Mismatches of the canvas as it is; reached is false while a texel is unfilled.
FillReport MeasureCanvas(const Canvas& canvas, const FillParams& params);

struct FillerScratch {
  CandidateSearch search;
  PatchCutter cutter;
  SearchQuery query;
};

// One per thread; keeps scratch memory.
class Filler {
 public:
  explicit Filler(const ExemplarSpectra& spectra)
      : spectra_(&spectra), scratch_{CandidateSearch(spectra), {}, {}} {}

  // Lays one patch given by the caller: its free texels in `window` are filled or improved.
  void Lay(const Window& window, const Patch& patch, Canvas& canvas, FillReport& report);
  // Lays what surrounds a placed feature in the exemplar, up to `margin` texels deep and as far as that
  // brings nothing excluded, so that the first seam is free to run where it is cheapest.
  void LayAround(const PlacedFeature& feature, int margin, Canvas& canvas, FillReport& report);

  // Lays first windows until nothing is unfilled. This and the two below depend on nothing but their
  // arguments and return CANCELLED within one patch search after a stop request.
  absl::Status LayEmpty(const FillParams& params, const RunContext& context, Canvas& canvas,
                        FillReport& report);
  // Matches bad seams again; nothing may be unfilled. The report tells whether the thresholds were reached.
  absl::Status Improve(const FillParams& params, const RunContext& context, Canvas& canvas,
                       FillReport& report);
  // LayEmpty, then Improve.
  absl::Status Fill(const FillParams& params, const RunContext& context, Canvas& canvas, FillReport& report);

 private:
  const ExemplarSpectra* spectra_;
  FillerScratch scratch_;
};

}  // namespace tessera
