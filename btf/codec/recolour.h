// Colour maps on coefficients: decoding is linear in them, so a linear map of RGB that is applied to the
// coefficients of the three channels is applied to every decoded value [Leung2007] 3.3.
//
//   const Eigen::Matrix3d bluer = HueSaturationMap(RadFromDeg(200.0), 1.3);
//   TESSERA_RETURN_IF_ERROR(RecolourTexels({&bluer, 1}, map_of_texel, material));
#pragma once

#include <cstdint>
#include <span>

#include <absl/status/status.h>
#include <Eigen/Core>

#include "btf/codec/material.h"

namespace tessera {

// Linear RGB from linear RGB: chroma is turned about the grey axis, positive from red towards green (a third
// of a turn takes one to the other), and scaled, then luminance (Rec. 709) is restored. Greys stay as they
// are.
[[nodiscard]] Eigen::Matrix3d HueSaturationMap(double hue_rad, double saturation);

// Maps the colours of the texels t with map_of_texel[t] = m > 0 by maps[m - 1]. Coefficients that outgrow
// their range get a new (offset, step) for the whole table, those that fit keep theirs, so texels without a
// map change by at most half a step, or not at all. Decoded values are mapped exactly up to that rounding and
// the clamp at 0. Codecs: "dsh*", "view-pca".
//
// Errors: INVALID_ARGUMENT (not one entry a texel, an unknown map, a map that is not finite), UNIMPLEMENTED
// naming a codec in which channels share coefficients.
[[nodiscard]] absl::Status RecolourTexels(std::span<const Eigen::Matrix3d> maps,
                                          std::span<const uint8_t> map_of_texel, Material& material);

}  // namespace tessera
