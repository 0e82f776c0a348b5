// Generated BTFs: a procedural or given periodic height field with colour and roughness, ray-traced into
// samples for every view and light, as a stream of rows.
//
//   GenerateParams params{.kind = "reactdiffuse", .views = views, .lights = lights, .seed = 7};
//   TESSERA_ASSIGN_OR_RETURN(auto source, GenerateBtf(params, context));
//   TESSERA_RETURN_IF_ERROR(source->ReadRows(0, 8, rows, context));
//
// Lengths are texels, heights too. The BTF is rectified onto a reference plane at the median height: the
// sample of a point of that plane follows the view ray through it to the first surface met from the viewer's
// side, so what stands above the plane shifts against the view and what lies below shifts with it, as in a
// measured, rectified BTF. A value is pi f_r cos(theta_i) with respect to the reference plane: the radiance
// of the texel's footprint under a distant light that sends irradiance pi through a plane facing it. The
// field repeats without end, so nothing is lost at its borders.
//
// Sources: [Leung2007] 4 names the two materials (REACTDIFFUSE, WRINKLES); [Pearson1993], [Walter2007],
// [Heitz2014], [Kelemen2001] as cited where used (btf/meso/README.md).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/data/btf_source.h"
#include "btf/image/image.h"
#include "btf/math/conventions.h"

namespace tessera {

struct GenerateParams {
  // One of GeneratorKinds().
  std::string kind;
  // Texels per side, [32, 1024]. Features of the procedural kinds keep their scale in texels (10 to 16).
  int size = 128;
  // Polar angles in [0, 89] degrees, azimuths finite; 1 to 4096 of each.
  std::vector<Direction> views;
  std::vector<Direction> lights;
  uint64_t seed = 1;
  // For kind "heightmap" only, which needs `height` and `colour`: square crops of the same region (the
  // central square is taken) in any resolution. `height` is read from the first channel; `colour` is the
  // diffuse albedo in [0, 1]; `roughness` in [0, 1] (first channel), 0.5 when absent. See heightmap.h for how
  // they become periodic.
  std::optional<Image> height;
  std::optional<Image> colour;
  std::optional<Image> roughness;
  // Texels per unit of height; the procedural fields span one unit. 0 takes the kind's own. At most size / 4.
  double height_scale_texels = 0;
  // Primary rays per texel and view, [1, 1024].
  int area_samples = 16;
  // Diffuse interreflections, [0, 16].
  int bounces = 2;
};

// The kinds GenerateBtf knows: reactdiffuse, holes, wrinkles, weave, heightmap.
[[nodiscard]] std::vector<std::string_view> GeneratorKinds();

// What can be known without the images: INVALID_ARGUMENT naming the parameter, its value and its range.
[[nodiscard]] absl::Status CheckGenerateParams(const GenerateParams& params);

// Makes the maps, then visibility and diffuse irradiance of every surface point under every light; ReadRows
// traces the view rays. Same parameters, same samples, for any number of threads and any blocking of rows.
// Reports progress in "points" (GenerateBtf) and "rows" (ReadRows). Cost at 128x128x81x81: seconds on two
// cores for both (tests/btf/meso prints it).
// Memory at 1024x1024 with 81 lights: 6.5 GiB; at 128x128: 360 MiB.
// info().provenance.source is "generated:KIND", followed by ",key=value" for each of size, seed,
// height-scale, area-samples and bounces that is not the default; licence CC0-1.0, but empty for "heightmap",
// whose images keep theirs. Errors: INVALID_ARGUMENT (kind, ranges, missing or unusable images),
// RESOURCE_EXHAUSTED (tables beyond 8 GiB), CANCELLED, INTERNAL (Embree refuses).
[[nodiscard]] absl::StatusOr<std::unique_ptr<BtfSource>> GenerateBtf(const GenerateParams& params,
                                                                     const RunContext& context);

}  // namespace tessera
