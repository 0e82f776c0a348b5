// From scene-referred linear light to what a display shows, still linear: exposure, then a tone curve. The
// sRGB transfer curve comes after (EncodePng).
//
//   TESSERA_RETURN_IF_ERROR(ApplyTone({.exposure_stops = 1.0, .curve = ToneCurve::kFilmic}, image));
#pragma once

#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/image/image.h"

namespace tessera {

enum class ToneCurve {
  kNone,  // values above 1 are clipped when the picture is encoded
  // L (1 + L / white^2) / (1 + L) on the luminance L, the colour scaled with it [Reinhard2002 eq. 4]. `white`
  // becomes 1; saturated colours may lie above and are clipped.
  kReinhard,
  // x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14) on each channel, at most 1: a fit of the ACES curve
  // [Narkowicz2015]. 0.18 becomes 0.27, 1 becomes 0.80.
  kFilmic,
};

struct Tone {
  double exposure_stops = 0.0;  // values are multiplied by 2^stops before the curve, -20..20
  ToneCurve curve = ToneCurve::kNone;
  double white = 4.0;  // of kReinhard, after exposure, 0.01..1e6

  friend bool operator==(const Tone&, const Tone&) = default;
};

// "none", "reinhard" or "filmic". Errors: INVALID_ARGUMENT naming the text and the legal ones.
[[nodiscard]] absl::StatusOr<ToneCurve> ParseToneCurve(std::string_view text);

// Errors: INVALID_ARGUMENT naming the member, its value and the limits.
[[nodiscard]] absl::Status CheckTone(const Tone& tone);

// In place; alpha stays. Not-a-number becomes 0 where a curve is applied. Gray images are their own
// luminance. Errors: those of CheckTone.
[[nodiscard]] absl::Status ApplyTone(const Tone& tone, Image& image);

}  // namespace tessera
