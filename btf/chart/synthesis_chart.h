// Tile synthesis against its baselines on one BTF: how visible seams are against how long it takes, and what
// the dimensions of the embedding, the number of candidates and the strip height change.
//
//   TESSERA_ASSIGN_OR_RETURN(SynthesisChart chart,
//                            ChartSynthesis("wool", *source, ChartSize::kFull, context));
//   std::string csv = SynthesisCsv({chart});
//   TESSERA_ASSIGN_OR_RETURN(std::string html, SynthesisHtml({chart}, {}));
//
// The source is encoded once, by the paper's basis ("dsh"), and embedded once. All is charted about one
// setting: each parameter varies while the others stay. Tiles of every method are judged alike, by the
// certificate (tiles/certificate.h) and in the embedding.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/chart/settings.h"
#include "btf/chart/tiles_table.h"
#include "btf/data/btf_source.h"
#include "btf/image/image.h"
#include "btf/tiles/exemplar.h"
#include "btf/tiles/synthesize.h"

namespace tessera {

// A method as published or as ours. Published methods price a seam by its mismatch.
struct ChartedMethod {
  const char* name;
  SynthesisMethod method;
  SeamRule seam_rule;
};
inline constexpr std::array kChartedMethods = {
    ChartedMethod{"diamond-dp", SynthesisMethod::kDiamondDp, SeamRule::kMismatch},
    ChartedMethod{"diamond-cut", SynthesisMethod::kDiamondCut, SeamRule::kMismatch},
    ChartedMethod{"frame, mismatch", SynthesisMethod::kFrame, SeamRule::kMismatch},
    ChartedMethod{"frame, excess", SynthesisMethod::kFrame, SeamRule::kExcess}};

struct SynthesisSetting {
  int dims = kCutDims;   // of the embedding, that candidates and cuts see
  int candidates = 0;    // sets of samples drawn at most; patches cut for a first window
  int strip_height = 0;  // overlap of diamonds
  uint64_t seed = 1;
  friend bool operator==(const SynthesisSetting&, const SynthesisSetting&) = default;
};

struct SynthesisPoint {
  size_t method = 0;  // of kChartedMethods
  SynthesisSetting setting;
  double seconds = 0.0;  // wall clock from the embedding to the tiles; no certificate
  int draws = 0;         // of sets of samples that were made; 0 for frames
  // Of the certificate.
  double borders_ratio = 0.0;
  double insides_ratio = 0.0;
  double insides_ratio_p95 = 0.0;  // over images
  double insides_cut_share = 0.0;  // of pairs
  double repetition = 0.0;
  double referenced_share = 0.0;
  // R of the certificate with distances in the codec's embedding in place of reflectance, in as many
  // dimensions as the cuts saw of theirs: steps across seams over the steps that the patches have there of
  // their own. Insides.
  double seen_ratio = 0.0;
  // Mean mismatch of a seam's two patches, both its texels, in units of the root mean square distance of two
  // texels drawn at random, in the codec's embedding: in as many dimensions as the cuts saw of theirs, and in
  // all. Insides.
  double seen_error = 0.0;
  double full_error = 0.0;

  [[nodiscard]] const ChartedMethod& charted() const { return kChartedMethods[method]; }
};

struct SynthesisChart {
  std::string name;
  int width = 0;  // of the part that is charted
  int height = 0;
  int tile_size = 0;
  ChartSize size = ChartSize::kFull;
  int embedding_dims = 0;
  double embed_s = 0.0;  // wall clock of both embeddings, once for all points
  // Share of the embedding's variance in the first 1, 2, .. dimensions.
  std::vector<double> captured;
  std::vector<SynthesisPoint> points;
  // One a method: tiles at the common setting under one light and view, and where their seams show.
  std::vector<Image> sheets;

  // The setting about which a method's parameters vary.
  [[nodiscard]] SynthesisSetting common(size_t method) const;
};

// Of the source the middle 256 texels, or what it has of them; kQuick takes 64, smaller tiles and fewer
// settings. Arrangement "plane-16"; thresholds are not enforced. Memory: 400 MiB at most for the images that
// R is measured in. Progress in "settings" of the stage "chart". Errors:
// INVALID_ARGUMENT naming the source when it is too small for tiles of the chart's size; those of the source
// and of Codec::Encode; CANCELLED.
[[nodiscard]] absl::StatusOr<SynthesisChart> ChartSynthesis(const std::string& name, BtfSource& source,
                                                            ChartSize size, const RunContext& context);

// One row each source and point. README.md describes the columns.
[[nodiscard]] std::string SynthesisCsv(const std::vector<SynthesisChart>& charts);

// One self-contained page, with the paper's table where there is one. Errors: INTERNAL (a picture).
[[nodiscard]] absl::StatusOr<std::string> SynthesisHtml(const std::vector<SynthesisChart>& charts,
                                                        const std::vector<TilesRow>& paper);

}  // namespace tessera
