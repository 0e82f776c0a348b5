// A recipe's features, placements, corners and colours, made ready for synthesis [Leung2007] 3.3.
//
//   TESSERA_ASSIGN_OR_RETURN(std::vector<Feature> features, ExtractFeatures(embedding, recipe));
//   TESSERA_RETURN_IF_ERROR(MoveColours(recipe, features, material));
//   TESSERA_ASSIGN_OR_RETURN(Controls controls, MakeControls(recipe, features, exemplar, arrangement, w, h));
//   TESSERA_ASSIGN_OR_RETURN(IndexMaps maps, SynthesizeIndexMaps(.., controls));
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/codec/material.h"
#include "btf/tiles/controls.h"
#include "btf/tiles/exemplar.h"
#include "btf/tiles/recipe.h"
#include "btf/tiles/seam_graph.h"

namespace tessera {

struct Feature {
  std::string name;
  std::vector<uint8_t> mask;  // [height][width] of the exemplar, 1 where it is
  Window box;                 // the smallest that holds it
  int num_texels = 0;
  bool only_placed = false;
};

// Segments the features of a recipe. Errors: those of SegmentFeature, with the key's path.
[[nodiscard]] absl::StatusOr<std::vector<Feature>> ExtractFeatures(const Embedding& embedding,
                                                                   const Recipe& recipe);

// Moves hue and saturation of features and background on the coefficients of `material`, whose features they
// are (codec/recolour.h). Errors: INVALID_ARGUMENT naming a texel that two recoloured features share; those
// of RecolourTexels.
[[nodiscard]] absl::Status MoveColours(const Recipe& recipe, const std::vector<Feature>& features,
                                       Material& material);

// What a tile set with this metadata was made of: `material` with its colours moved; none when it has no
// recipe that moves any. Errors: of the two above and of Codec::Embed.
[[nodiscard]] absl::StatusOr<std::optional<Material>> RecolouredAs(const nlohmann::json& metadata,
                                                                   const Material& material,
                                                                   const RunContext& context);

// Errors: INVALID_ARGUMENT with the key's path and figures: a feature that is not inside its strip between
// the corner samples, or inside its tile within the border row; placements that overlap; a corner sample that
// is not inside the exemplar or holds texels that are only placed; those of CheckRecipe.
[[nodiscard]] absl::StatusOr<Controls> MakeControls(const Recipe& recipe,
                                                    const std::vector<Feature>& features,
                                                    const Exemplar& exemplar, const Arrangement& arrangement,
                                                    int tile_size, int strip_height);

}  // namespace tessera
