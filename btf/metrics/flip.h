// LDR-FLIP: the difference of two pictures as seen when flipping between them, in [0, 1].
//
//   double d = Flip(reference, decoded);   // linear RGB
//
// Source: [Andersson2020], its sections 4.1 (colour: contrast sensitivity filters in YCxCz, HyAB distance in
// Hunt-adjusted L*a*b*, redistribution), 4.2 (features: edges and points by Gaussian derivatives) and 4.3
// (combination), with its constants; written from the description, not from the authors' code. Borders
// repeat. Differs in nothing known; results agree with hand-computed cases to 1e-3 (tests).
#pragma once

#include "btf/image/image.h"

namespace tessera {

// A monitor 0.7 m wide with 3,840 pixels, seen from 0.7 m: the paper's default.
inline constexpr double kFlipPixelsPerDegree = 67.0;

// Per pixel, [height][width][1]. Both linear RGB of one shape (CheckComparable); values are clamped to [0,
// 1].
[[nodiscard]] Image FlipMap(const Image& reference, const Image& image,
                            double pixels_per_degree = kFlipPixelsPerDegree);

// The mean of the map.
[[nodiscard]] double Flip(const Image& reference, const Image& image,
                          double pixels_per_degree = kFlipPixelsPerDegree);

}  // namespace tessera
