// How much a material differs from its own quarter turn.
#pragma once

#include "btf/base/run_context.h"
#include "btf/tiles/exemplar.h"

namespace tessera {

// Side of the patches that are compared, in texels.
inline constexpr int kAnisotropyPatch = 8;
// Side of the square in the middle of the exemplar beyond which texels are not looked at.
inline constexpr int kAnisotropySide = 128;
// Turned strips are refused above it. At 128 x 128 texels, 81 views and 81 lights, generated holes,
// reaction-diffusion and wrinkles measure 0.96 to 1.00, Leather025 1.00 and Rock031 1.20; generated plain
// weave, whose warp is of another colour than its weft, 1.52 and the knitted wool of UBO2003 3.3.
inline constexpr double kAnisotropyLimit = 1.35;

// Mean distance of a patch to its nearest like in another crop, after a quarter turn over before one: 1 for
// an isotropic material, above it where the turned material does not find itself again. The crops are the
// two halves of the exemplar, left and right, then upper and lower, each looked for in the other. Patches are
// kAnisotropyPatch texels square; those looked for stand side by side, those looked at are all that the other
// half holds. The distance is the root mean square over texels and search dimensions of the points
// themselves, not about a mean, so that a mean reflectance that turns (brushed metal) counts as a pattern
// does. A turned patch is made of turned texels (exemplar.h): light and view turn with it, and bumps lit from
// their own side turn into bumps lit from their own side. The figure after a turn is the mean of a quarter
// and three quarters. Distances below 1% of the exemplar's spread count as that, so that a material that
// repeats itself exactly has a finite figure; one of less than two patches a side reads 1.
//
// Exact and the same for any number of threads. Cost at most that of 12 products of 128 x 1,024 with
// 1,024 x 6,897 values, 22 GFLOP. On a stop request the figure means nothing.
[[nodiscard]] double MeasureAnisotropy(const Exemplar& exemplar, const RunContext& context);

}  // namespace tessera
