// Job kind "thumbnail": the picture that lists show of a tile set.
//
// No parameters. Input: the container of the tile set. The result is a PNG of kThumbnailSide x kThumbnailSide
// pixels, sRGB, without alpha: a square of 2 x 2 tiles, dressed with seed 1, that fills the picture. The eye
// is on the axis of the square, which it sees under 35 degrees; one directional light of irradiance pi comes
// from (-0.4, 0.5, 0.8), over the viewer's left shoulder. Drawn with a texel a pixel at most, up to 16 times
// as large, and averaged: a picture costs what its four tiles do, whatever the set holds. The same bytes for
// any number of threads.
#pragma once

#include <absl/status/statusor.h>

#include "server/jobs/job.h"

namespace tessera {

inline constexpr int kThumbnailSide = 128;

// Draws in an OpenGL context of its own, which no other thread uses. Errors: ParseTileSet's, DressMesh's,
// RenderGl's, UNAVAILABLE where OSMesa offers no context.
[[nodiscard]] absl::StatusOr<JobOutput> RunThumbnailJob(const JobInput& input, const JobContext& context);

}  // namespace tessera
