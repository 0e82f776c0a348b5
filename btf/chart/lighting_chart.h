// Ways of light from all around against each other: error against time of lights by importance, with shadows
// and without, and of the frequency domain.
//
//   TESSERA_ASSIGN_OR_RETURN(LightingChart chart, ChartLighting("wool", *source, environments,
//   ChartSize::kFull,
//                                                               *gl, context));
//   std::string csv = LightingCsv({chart});
//   TESSERA_ASSIGN_OR_RETURN(std::string html, LightingHtml({chart}));
//
// A torus wears the material, whose texels lie on each of its faces as they come. The truth is a sum over
// every texel of the environment in double precision (render/reference.h), with the torus's shadows on itself
// and without. Environments are reduced first, for every way alike.
#pragma once

#include <array>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/chart/settings.h"
#include "btf/data/btf_source.h"
#include "btf/image/image.h"
#include "btf/light/environment.h"

namespace tessera {

class OffscreenContext;

enum class LightingMethod { kLights, kShadowedLights, kFrequency };
inline constexpr std::array<const char*, 3> kLightingMethodNames = {"lights", "lights with shadows",
                                                                    "frequency domain"};

struct NamedEnvironment {
  std::string name;
  Environment environment;
};

struct LightingPoint {
  LightingMethod method = LightingMethod::kLights;
  int count = 0;                // of lights, or the order: its square is the number of harmonics
  double seconds = 0.0;         // wall clock of a further picture in GL, without preparing lights
  double error = 0.0;           // against the truth without shadows
  double shadowed_error = 0.0;  // against that with shadows
};

struct LitPicture {
  std::string title;
  Image image;  // linear RGBA
};

struct LightingEnvironment {
  std::string name;
  int height = 0;            // as charted
  double peak = 0.0;         // largest over mean radiance, of luminance
  double shadow_cost = 0.0;  // error of the truth without shadows against that with them
  std::vector<LightingPoint> points;
  std::vector<LitPicture> pictures;  // truths first
};

struct LightingChart {
  std::string name;
  std::string codec;
  int width = 0;  // of the pictures
  int height = 0;
  double one_light_s = 0.0;  // the same picture under one light
  std::vector<LightingEnvironment> environments;
};

// Errors are the root of the mean square difference over the root mean square of the truth, linear RGB, over
// the pixels that the torus covers whole. kQuick: small pictures, 12 rows of the environment, fewer points.
// Progress in "pictures" of the stage "chart". Errors: INVALID_ARGUMENT (no environments; what the codec
// refuses); those of the source and of GL; CANCELLED.
[[nodiscard]] absl::StatusOr<LightingChart> ChartLighting(const std::string& name, BtfSource& source,
                                                          const std::vector<NamedEnvironment>& environments,
                                                          ChartSize size, OffscreenContext& gl,
                                                          const RunContext& context);

// One row each source, environment and point. README.md describes the columns.
[[nodiscard]] std::string LightingCsv(const std::vector<LightingChart>& charts);

// One self-contained page. Errors: INTERNAL (a picture).
[[nodiscard]] absl::StatusOr<std::string> LightingHtml(const std::vector<LightingChart>& charts);

}  // namespace tessera
