// Whether a material repeats itself in regular steps (cloth, bricks), and which sizes of tiles keep step.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "btf/tiles/autocorrelation.h"

namespace tessera {

// Texels right and down.
using PeriodVector = std::array<double, 2>;

struct Period {
  // The two shortest that are not parallel, the shortest first; one for stripes. Not always whole texels.
  std::vector<PeriodVector> vectors;
};

// An autocorrelation as high as this beyond the first feature is a period. Materials without one stay below
// 0.35 (generated reaction-diffusion 0.30, Rock031 0.11), generated weave reads 0.9, the wool of UBO2003
// 0.83.
inline constexpr double kPeriodicCorrelation = 0.5;

// Reads the period from an exemplar's autocorrelation, best over half its sides. Peaks nearly as high as the
// highest count; the shortest shifts among them are then sharpened by all of their multiples. None where no
// peak reaches kPeriodicCorrelation.
[[nodiscard]] std::optional<Period> FindPeriod(const Autocorrelation& autocorrelation);

// How far, in texels, tiles `tile_size` wide and high are out of step: the longer of the distances of a shift
// by one tile along x and along y from the nearest sum of whole periods.
[[nodiscard]] double PeriodSlip(const Period& period, int tile_size);
// Slip that seams take up: an eighth of the shortest period.
[[nodiscard]] double LargestSlip(const Period& period);

// Of the sizes in [least, most] that are in step, at least as much so as the sizes on either side, the one
// nearest to `tile_size`, of two as near that with less slip; none when there is none.
[[nodiscard]] std::optional<int> TileSizeInStep(const Period& period, int tile_size, int least, int most);

// The mean over period vectors of the autocorrelation at their smallest multiples that are `distance` long or
// longer, or their largest within reach; of each the highest value within an eighth of the shortest period.
// `shrink`: texels a pixel of `autocorrelation`.
[[nodiscard]] double CorrelationInStep(const Autocorrelation& autocorrelation, const Period& period,
                                       double distance, int shrink);

}  // namespace tessera
