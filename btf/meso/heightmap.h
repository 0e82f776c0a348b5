// Maps from given images: a height field, its colour and, if given, its roughness.
//
// 1. The central square of each image is taken; all must have the same aspect ratio within 2%, because they
// show
//    the same region.
// 2. Resampling to the tracer's vertices is by a tent as wide as the coarser of both spacings.
// 3. The field must repeat. Along each axis, the step across the image's border (first against last pixel) is
//    compared with the mean step between neighbours inside: where it is at most kPeriodicRatio times as large
//    in height and colour, the image repeats already and stays as it is. Otherwise its last kBlendShare of
//    pixels is laid over its first ones with a weight that runs linearly from all to nothing; what remains, 1
//    - kBlendShare of the image, is continuous across its border and fills the period.
#pragma once

#include <absl/status/statusor.h>

#include "btf/image/image.h"
#include "btf/meso/procedural_maps.h"
#include "btf/meso/surface_maps.h"

namespace tessera {

inline constexpr double kPeriodicRatio = 2.0;
inline constexpr double kBlendShare = 0.125;
// Texels per unit of height when none are given.
inline constexpr double kHeightmapScale = 8.0;
// When no roughness is given.
inline constexpr float kHeightmapRoughness = 0.5F;

// Height is read from the first channel, params.height_scale_texels per unit; `roughness` may be null.
// Errors: INVALID_ARGUMENT names the image and what is wrong: size 0 or its pixel count not width x height x
// channels, channels not 1, 3 or 4, a pixel that is not finite, colour or roughness outside [0, 1], aspect
// ratios that differ, heights whose range exceeds size / 4 texels.
[[nodiscard]] absl::StatusOr<SurfaceMaps> MapsFromImages(const MapParams& params, const Image& height,
                                                         const Image& colour, const Image* roughness);

}  // namespace tessera
