// Structural similarity in the form of its authors' reference code: a Gaussian window of 11 x 11 pixels,
// sigma 1.5, K1 = 0.01, K2 = 0.03, L = 1, windows wholly inside the picture, the mean over windows. Here of
// sRGB-coded values, the mean over the three channels. In pictures smaller than the window it is cut to their
// size. Source: [Wang2004] eq. 13.
//
//   double d = Dssim(SrgbCoded(reference), SrgbCoded(decoded));
#pragma once

#include "btf/image/image.h"

namespace tessera {

// Values clamped to [0, 1] and sRGB-coded, all channels alike.
[[nodiscard]] Image SrgbCoded(const Image& linear);

// Both of one shape (CheckComparable), values in [0, 1]. At most 1, for equal pictures.
[[nodiscard]] double Ssim(const Image& reference, const Image& image);

// (1 - SSIM) / 2: 0 for equal pictures, at most 1.
[[nodiscard]] double Dssim(const Image& reference, const Image& image);

}  // namespace tessera
