// The four procedural materials. Each makes height, albedo and roughness of one period, features 10 to 16
// texels large whatever the size, so that strips of 16 texels hold them.
#pragma once

#include <cstdint>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/meso/surface_maps.h"

namespace tessera {

struct MapParams {
  int size = 128;           // texels
  int cells_per_texel = 2;  // surface_maps.h
  // Texels between the lowest and the highest point; 0 takes the kind's own.
  double height_scale_texels = 0.0;
  uint64_t seed = 1;
};

// Glazed brain coral: the labyrinth of the Gray-Scott reaction [Pearson1993], F = 0.0545, k = 0.062.
// Isotropic. Errors: CANCELLED.
[[nodiscard]] absl::StatusOr<SurfaceMaps> MakeReactDiffuse(const MapParams& params,
                                                           const RunContext& context);

// A slab with round holes of two to five texels' radius at blue-noise places, lips raised. Isotropic.
[[nodiscard]] absl::StatusOr<SurfaceMaps> MakeHoles(const MapParams& params, const RunContext& context);

// Leather: rounded grains between branching creases, the zero lines of isotropic noise. Isotropic.
[[nodiscard]] absl::StatusOr<SurfaceMaps> MakeWrinkles(const MapParams& params, const RunContext& context);

// Plain-woven cloth of two colours: warp and weft pass over and under each other, twisted fibres on each
// yarn. Not isotropic in colour.
[[nodiscard]] absl::StatusOr<SurfaceMaps> MakeWeave(const MapParams& params, const RunContext& context);

}  // namespace tessera
