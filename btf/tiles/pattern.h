// What synthesis wants to know of a material before it starts: may strips be turned, how large are features,
// does it repeat in regular steps; and the sizes that follow where none are asked for.
//
//   TESSERA_ASSIGN_OR_RETURN(MaterialPattern pattern, MeasurePattern(exemplar, context));
//   int height = StripHeightFor(pattern, exemplar.width(), exemplar.height(), /*tile_size=*/64);
#pragma once

#include <optional>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"
#include "btf/tiles/exemplar.h"
#include "btf/tiles/regularity.h"

namespace tessera {

struct MaterialPattern {
  double anisotropy = 1.0;  // anisotropy.h
  // Texels: three times the width of the autocorrelation's peak at half its height, the mean over directions,
  // within half the exemplar. That is the wavelength of waves. 0 of a constant exemplar.
  double feature_size = 0.0;
  std::optional<Period> period;
};

inline constexpr int kDefaultTileSize = 64;
inline constexpr int kSmallestStrip = 8;

// Errors: CANCELLED.
[[nodiscard]] absl::StatusOr<MaterialPattern> MeasurePattern(const Exemplar& exemplar,
                                                             const RunContext& context);

// The same of a material, in its codec's embedding. Errors: those of Codec::Embed, INVALID_ARGUMENT naming an
// unknown codec.
[[nodiscard]] absl::StatusOr<MaterialPattern> MeasureMaterialPattern(const Material& material,
                                                                     const RunContext& context);

// Keys: anisotropy, anisotropy_limit, feature_size; of a regular material period, its vectors.
[[nodiscard]] nlohmann::json DescribePattern(const MaterialPattern& pattern);

// The feature size as an even number, at least kSmallestStrip, at most half a tile and a tenth of the
// exemplar's shorter side: in an exemplar of fewer strips a strip has too few places to come from, and its
// seams show more than the features that a lower one chops (btf/tiles/README.md has the figures).
[[nodiscard]] int StripHeightFor(const MaterialPattern& pattern, int exemplar_width, int exemplar_height,
                                 int tile_size);

// kDefaultTileSize or twice `strip_height` (0: not given), whichever is more; where the period is to be kept,
// the nearest size up to twice that which is in step, if there is one.
[[nodiscard]] int TileSizeFor(const MaterialPattern& pattern, int strip_height, bool keep_period);

}  // namespace tessera
