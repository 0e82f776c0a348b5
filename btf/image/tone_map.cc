#include "btf/image/tone_map.h"

#include <algorithm>
#include <cmath>
#include <string>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

constexpr double kMostStops = 20.0;
constexpr double kLeastWhite = 0.01;
constexpr double kMostWhite = 1e6;
// Beyond this all curves are flat; its square is still far from overflow.
constexpr double kBrightest = 1e12;

// Not-a-number is below every number.
double Bounded(double value) {
  return value > 0.0 ? std::min(value, kBrightest) : 0.0;
}

double Filmic(double value) {
  const double x = Bounded(value);
  return std::min(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 1.0);
}

// What a colour of this luminance is multiplied by.
double ReinhardScale(double luminance, double white) {
  return (1.0 + luminance / (white * white)) / (1.0 + luminance);
}

}  // namespace

absl::StatusOr<ToneCurve> ParseToneCurve(std::string_view text) {
  if (text == "none") {
    return ToneCurve::kNone;
  }
  if (text == "reinhard") {
    return ToneCurve::kReinhard;
  }
  if (text == "filmic") {
    return ToneCurve::kFilmic;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("tone curve \"", std::string(text), "\": expected none, reinhard or filmic"));
}

absl::Status CheckTone(const Tone& tone) {
  if (!(std::abs(tone.exposure_stops) <= kMostStops)) {
    return absl::InvalidArgumentError(absl::StrCat("exposure: ", tone.exposure_stops, " stops, expected ",
                                                   -kMostStops, " to ", kMostStops));
  }
  if (!(tone.white >= kLeastWhite && tone.white <= kMostWhite)) {
    return absl::InvalidArgumentError(
        absl::StrCat("white: ", tone.white, ", expected ", kLeastWhite, " to ", kMostWhite));
  }
  return absl::OkStatus();
}

absl::Status ApplyTone(const Tone& tone, Image& image) {
  TESSERA_RETURN_IF_ERROR(CheckTone(tone));
  const double exposure = std::exp2(tone.exposure_stops);
  const int colours = image.channels == 4 ? 3 : image.channels;
  for (size_t first = 0; first + image.channels <= image.pixels.size(); first += image.channels) {
    float* const pixel = image.pixels.data() + first;
    double scale = exposure;
    if (tone.curve == ToneCurve::kReinhard) {
      for (int c = 0; c < colours; ++c) {
        pixel[c] = static_cast<float>(Bounded(exposure * pixel[c]));
      }
      // Of linear sRGB primaries [IEC 61966-2-1].
      const double luminance =
          colours == 1 ? pixel[0] : 0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2];
      scale = ReinhardScale(luminance, tone.white);
    }
    for (int c = 0; c < colours; ++c) {
      const double value = scale * pixel[c];
      pixel[c] = static_cast<float>(tone.curve == ToneCurve::kFilmic ? Filmic(value) : value);
    }
  }
  return absl::OkStatus();
}

}  // namespace tessera
