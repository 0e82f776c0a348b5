// Which texels of an exemplar are a feature, from strokes or a rectangle that a person gave: iterated minimum
// cuts between two colour models, here of BTFels, so that what a light or a view shows counts as much as
// colour.
//
//   SegmentationGuide guide{.rectangle = Window{20, 14, 18, 18}};
//   TESSERA_ASSIGN_OR_RETURN(std::vector<uint8_t> mask, SegmentFeature(embedding, guide));
//
// Sources: [Boykov2001] Y. Boykov, M.-P. Jolly: Interactive graph cuts. ICCV 2001; [Rother2004] C. Rother, V.
// Kolmogorov, A. Blake: GrabCut. SIGGRAPH 2004. Differs: points of the embedding instead of RGB, 4 neighbours
// instead of 8, k-means anew in every round; the result is one piece without holes.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/codec/codec.h"
#include "btf/tiles/seam_graph.h"

namespace tessera {

// A polyline of texels (x, y) of the unturned exemplar, at least one point.
using Stroke = std::vector<std::array<int, 2>>;

// At least a rectangle or a stroke of the feature.
struct SegmentationGuide {
  std::vector<Stroke> feature;      // are the feature
  std::vector<Stroke> background;   // are not
  std::optional<Window> rectangle;  // what lies outside is not
};

// [height][width], 1 where the feature is: the connected pieces that hold a stroke of the feature (without
// one, the largest piece), and what they enclose unless a stroke of the background lies in it. The same for
// the same input. Cost: about ten minimum cuts of the exemplar.
//
// Errors: INVALID_ARGUMENT naming the point or rectangle that lies outside, a texel that both kinds of
// strokes claim, a point of the embedding that is not finite, a feature without guide, or a result that is
// empty or leaves no background.
[[nodiscard]] absl::StatusOr<std::vector<uint8_t>> SegmentFeature(const Embedding& embedding,
                                                                  const SegmentationGuide& guide);

}  // namespace tessera
