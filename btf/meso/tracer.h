// The BTF of a height field, traced row by row.
//
// Sample of texel (x, row), view wo, light wi: `area_samples` points spread over the texel's square of the
// reference plane z = 0; the ray through each along wo meets the surface first, coming from the viewer, at a
// point with facet normal n; the mean over the points of
//   pi f_s n.wi visible + diffuse[c] (1 - E(n.wo)) (Direct visible + Indirect[c])        (surface_light.h)
// Light transport: direct light on both lobes, up to `bounces` diffuse interreflections; mirrored
// interreflections are left out, so the result is at most what energy conservation allows.
//
// Per view and point one primary ray; visibility is looked up at the surface point (facets.h) of the hit, of
// which there are at least as many per texel as area samples; the lobe is evaluated per sample and light.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/data/btf_source.h"
#include "btf/meso/surface_maps.h"

namespace tessera {

struct TraceOptions {
  int area_samples = 16;
  int bounces = 2;
  uint64_t seed = 1;
};

// Facet parts per edge so that a texel has at least `area_samples` surface points.
[[nodiscard]] int EdgePartsFor(int area_samples, int cells_per_texel);

// A source that traces `maps` for info.views and info.lights; info's width and height must be maps.size.
// Fields must be finite and of the sizes surface_maps.h states, polar angles at most 89 degrees. Errors:
// CANCELLED, INTERNAL (Embree).
[[nodiscard]] absl::StatusOr<std::unique_ptr<BtfSource>> TraceHeightField(SurfaceMaps maps, BtfInfo info,
                                                                          const TraceOptions& options,
                                                                          const RunContext& context);

}  // namespace tessera
