// A tile set from a material and an arrangement: corners, edges, frames, interior [Leung2007] 3.2.
//
//   TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement("surface-96"));
//   TESSERA_ASSIGN_OR_RETURN(TileSet set, SynthesizeTileSet(material, *arrangement,
//                                                           {.tile_size = 64, .strip_height = 16}, context));
//   uint32_t texel = set.texel(tile, x, y);   // a BTFel of set.btfels and its quarter turns
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"
#include "btf/tiles/exemplar.h"
#include "btf/tiles/recipe.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/tile_set.h"

namespace tessera {

// kFrame is ours; the others are baselines, see diamonds.h.
enum class SynthesisMethod { kFrame, kDiamondDp, kDiamondCut };
inline constexpr std::array kSynthesisMethods = {SynthesisMethod::kFrame, SynthesisMethod::kDiamondDp,
                                                 SynthesisMethod::kDiamondCut};
// "frame", "diamond-dp", "diamond-cut".
[[nodiscard]] std::string_view SynthesisMethodName(SynthesisMethod method);
// Errors: INVALID_ARGUMENT naming the method and those known.
[[nodiscard]] absl::StatusOr<SynthesisMethod> ParseSynthesisMethod(std::string_view name);

struct DiamondParams {
  // A set of samples is taken once the error of all its overlaps is below this, in units of the mean squared
  // distance of two texels drawn at random: d_max of [PCAWang] 4.1.
  double largest_error = 0.5;
  int num_draws = 256;  // sets drawn while none is; then the best of them is taken
};

inline constexpr int kMostEffort = 100;

struct SynthesisParams {
  // SynthesizeTileSet chooses what is 0 from the material, by TileSizeFor and StripHeightFor of pattern.h.
  int tile_size = 64;     // w, texels, at least 2 h; even for diamonds
  int strip_height = 16;  // h, texels, even, at least 8: about the size of a feature; overlap of diamonds
  uint64_t seed = 1;
  // Synthesise turned strips of an anisotropic material all the same, and keep strips and tiles that miss a
  // threshold: metadata.thresholds_reached tells.
  bool force = false;
  SynthesisMethod method = SynthesisMethod::kFrame;
  SeamRule seam_rule = SeamRule::kExcess;
  // Patches cut for each window of a strip that is improved; 5/8 of it, rounded up, for each of a tile, and
  // half of it for each that is filled. At least 1.
  int num_candidates = 16;
  // How many times as many windows are tried while seams show more than the material's own steps do, and how
  // many times nearer to those they must come to be good. In [1, kMostEffort].
  int effort = 1;
  DiamondParams diamonds;
  std::optional<Recipe> recipe;  // of kFrame
  // A filled strip or tile must reach both. In units of the material's mean embedding distance of
  // neighbouring texels:
  double mean_threshold = 3.0;  // mean cost along cuts, a mismatch or its excess
  // In units of the root mean square distance of two texels drawn at random:
  double texel_threshold = 2.0;  // largest cost of one cut pair
};

// Every texel of the result is a BTFel of `material` with a turn (0 throughout for "plane-*"); the table
// keeps the referenced BTFels in ascending exemplar order. Colours of a recipe are moved first, on a copy of
// the material, whose BTFels they then are. Same material, arrangement and parameters give the same bytes for
// any number of threads. Metadata: seed, method, parameters, `pattern` (DescribePattern), captured variance,
// thresholds and what was reached, the recipe and the features that it found; `notes` and `warnings`,
// sentences: why a size was chosen, and that tiles cannot keep a regular material's period. Certificate: see
// certificate.h.
//
// Errors, with reasons as in btf/base/reason.h: INVALID_ARGUMENT naming the size and its limit (reason
// MATERIAL_TOO_SMALL when the exemplar is the cause), an unknown codec, or the recipe's key (features.h);
// UNIMPLEMENTED when colours of a codec cannot be moved (codec/recolour.h); FAILED_PRECONDITION with reason
// NOT_ISOTROPIC (turned strips only, unless forced) or THRESHOLD_NOT_REACHED (unless forced), each with its
// figures; CANCELLED within one patch search. Progress: stages "corners", "strips", "laying",
// "tiles" and "certificate"; of diamonds, whose thresholds are told but not enforced, "samples", "tiles" and
// "certificate".
[[nodiscard]] absl::StatusOr<TileSet> SynthesizeTileSet(const Material& material,
                                                        const Arrangement& arrangement,
                                                        const SynthesisParams& params,
                                                        const RunContext& context);

}  // namespace tessera
