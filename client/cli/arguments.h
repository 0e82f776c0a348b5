// The small languages of the command line: "640x480", "45,135", "point:0,1,3".
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/math/conventions.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera::cli {

// Every parser's error is a UsageError that quotes the text and the legal form.

// "WxH", both 16..8192.
struct PictureSize {
  uint32_t width = 0;
  uint32_t height = 0;
};
[[nodiscard]] absl::StatusOr<PictureSize> ParsePictureSize(std::string_view text);

// "TH,PH" in degrees, polar 0..90 from the normal, azimuth counter-clockwise from the columns.
[[nodiscard]] absl::StatusOr<Direction> ParseDirection(std::string_view text);

// "TH,PH[,S]": from that direction, polar from the +z axis (towards the viewer of an unturned scene), azimuth
// from +x towards +y; irradiance S pi, S = 1 when left out; "TH,PH,R,G,B" for a coloured one.
// "point:X,Y,Z[,S]" or "point:X,Y,Z,R,G,B": a point light there, irradiance S pi at distance 1.
[[nodiscard]] absl::StatusOr<v1::Light> ParseLight(std::string_view text);

// "X,Y,Z". `what` names it in the error.
[[nodiscard]] absl::StatusOr<std::array<double, 3>> ParsePlace(std::string_view what, std::string_view text);

// "AZ,EL[,DISTANCE]", degrees and a factor above 0; legal ranges are the server's.
[[nodiscard]] absl::StatusOr<v1::Orbit> ParseOrbit(std::string_view text);

enum class PictureFormat { kPng, kExr };
// By the ending of an output path, .png or .exr.
[[nodiscard]] absl::StatusOr<PictureFormat> PictureFormatOf(std::string_view path);

// The name of a built-in shape when `text` is "builtin:NAME".
[[nodiscard]] std::optional<std::string> BuiltinName(std::string_view text);

}  // namespace tessera::cli
