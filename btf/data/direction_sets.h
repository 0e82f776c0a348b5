// The direction sets by name that generators and tests use, and that measured sets are compared with.
//
//   TESSERA_ASSIGN_OR_RETURN(std::vector<Direction> views, DirectionSet("ubo81"));
#pragma once

#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/math/conventions.h"

namespace tessera {

// Directions in order of polar angle, then azimuth. Azimuths of a ring of n are 360 i / n degrees.
//
// "ubo81": 81, those of the UBO2003 measurements [Sattler2003]: theta 0: 1; 15: 6; 30: 12; 45: 18; 60: 20;
// 75: 24.
//
// "curet": 50, after CUReT [Dana1999], whose views lie 22.5 degrees apart: rings at the odd multiples of
// 11.25 degrees. Its 205 pairs of a light and a view are no product of a view set and a light set, so this is
// our construction: the rings are filled evenly, samples about 20 degrees apart: theta 11.25: 4; 33.75: 10;
// 56.25: 16; 78.75: 20. No sample at the normal; 50 as the lights of WRINKLES [Leung2007, Table I].
//
// "NxM": N polar angles 90 (i + 1/2) / N, midpoints of N equal steps, so neither the pole nor the horizon is
// sampled, by M azimuths. 1 <= N <= 90, 1 <= M <= 360, N M <= 1024.
//
// Errors: INVALID_ARGUMENT naming the text and the legal forms.
[[nodiscard]] absl::StatusOr<std::vector<Direction>> DirectionSet(std::string_view name);

}  // namespace tessera
