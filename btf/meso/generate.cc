#include "btf/meso/generate.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <string>
#include <utility>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/meso/heightmap.h"
#include "btf/meso/procedural_maps.h"
#include "btf/meso/surface_light.h"
#include "btf/meso/surface_maps.h"
#include "btf/meso/tracer.h"

namespace tessera {
namespace {

constexpr int kMinSize = 32;
constexpr int kMaxSize = 1024;
constexpr int kMaxDirections = 4096;
constexpr int kMaxAreaSamples = 1024;
constexpr int kMaxBounces = 16;
constexpr double kMaxPolarDeg = 89.0;
constexpr double kPolarSlackDeg = 1e-6;  // rounding of degrees to radians
constexpr double kMaxBytes = 8.0 * (uint64_t{1} << 30U);
// Two cells per texel resolve what a texel averages; beyond this size one, so that tables stay within memory.
constexpr int kLargestFineSize = 256;

constexpr std::string_view kHeightmap = "heightmap";

absl::Status ValidateDirections(const char* name, const std::vector<Direction>& directions) {
  if (directions.empty() || directions.size() > kMaxDirections) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, "s: ", directions.size(), " directions, expected 1 to ", kMaxDirections));
  }
  for (size_t i = 0; i < directions.size(); ++i) {
    const double polar_deg = DegFromRad(directions[i].theta_rad);
    if (!(polar_deg >= 0.0 && polar_deg <= kMaxPolarDeg + kPolarSlackDeg)) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " ", i, ": polar angle ", polar_deg, " deg, expected 0 to ", kMaxPolarDeg));
    }
    if (!std::isfinite(directions[i].phi_rad)) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " ", i, ": azimuth ", directions[i].phi_rad, " is not finite"));
    }
  }
  return absl::OkStatus();
}

absl::Status ValidateRange(const char* name, int value, int low, int high) {
  if (value < low || value > high) {
    return absl::InvalidArgumentError(absl::StrCat(name, " ", value, ", expected ", low, " to ", high));
  }
  return absl::OkStatus();
}

absl::Status ValidateImages(const GenerateParams& params) {
  const bool is_heightmap = params.kind == kHeightmap;
  if (is_heightmap && (!params.height || !params.colour)) {
    return absl::InvalidArgumentError(
        absl::StrCat("kind heightmap needs ", params.height ? "a colour" : "a height", " image"));
  }
  if (!is_heightmap && (params.height || params.colour || params.roughness)) {
    return absl::InvalidArgumentError(
        absl::StrCat("kind ", params.kind, " takes no images; kind heightmap does"));
  }
  return absl::OkStatus();
}

absl::StatusOr<SurfaceMaps> MakeMaps(const GenerateParams& params, const MapParams& map_params,
                                     const RunContext& context) {
  if (params.kind == kHeightmap) {
    return MapsFromImages(map_params, *params.height, *params.colour,
                          params.roughness ? &*params.roughness : nullptr);
  }
  if (params.kind == "reactdiffuse") {
    return MakeReactDiffuse(map_params, context);
  }
  if (params.kind == "holes") {
    return MakeHoles(map_params, context);
  }
  if (params.kind == "wrinkles") {
    return MakeWrinkles(map_params, context);
  }
  return MakeWeave(map_params, context);
}

// "generated:KIND" and, so that the source can be made again, every parameter that is not the default.
std::string SourceOf(const GenerateParams& params) {
  const GenerateParams defaults;
  std::string source = absl::StrCat("generated:", params.kind);
  if (params.size != defaults.size) {
    absl::StrAppend(&source, ",size=", params.size);
  }
  if (params.seed != defaults.seed) {
    absl::StrAppend(&source, ",seed=", params.seed);
  }
  if (params.height_scale_texels != defaults.height_scale_texels) {
    absl::StrAppend(&source, ",height-scale=", params.height_scale_texels);
  }
  if (params.area_samples != defaults.area_samples) {
    absl::StrAppend(&source, ",area-samples=", params.area_samples);
  }
  if (params.bounces != defaults.bounces) {
    absl::StrAppend(&source, ",bounces=", params.bounces);
  }
  return source;
}

// GenerateBtf of valid parameters.
absl::StatusOr<std::unique_ptr<BtfSource>> Generate(const GenerateParams& params, const RunContext& context) {
  const MapParams map_params{.size = params.size,
                             .cells_per_texel = params.size <= kLargestFineSize ? 2 : 1,
                             .height_scale_texels = params.height_scale_texels,
                             .seed = params.seed};
  const int resolution = params.size * map_params.cells_per_texel;
  const double bytes =
      SurfaceLight::PeakBytes(int64_t{2} * resolution * resolution, static_cast<int>(params.lights.size()),
                              EdgePartsFor(params.area_samples, map_params.cells_per_texel), params.bounces);
  if (bytes > kMaxBytes) {
    return absl::ResourceExhaustedError(absl::StrCat(
        "generating ", params.size, "x", params.size, " with ", params.lights.size(), " lights and ",
        params.area_samples, " area samples takes ", static_cast<int64_t>(bytes / (1 << 20)), " MiB, limit ",
        static_cast<int64_t>(kMaxBytes / (1 << 20)), " MiB"));
  }
  TESSERA_ASSIGN_OR_RETURN(SurfaceMaps maps, MakeMaps(params, map_params, context));
  CentreOnReferencePlane(maps);
  const bool is_heightmap = params.kind == kHeightmap;
  BtfInfo info{
      .width = params.size,
      .height = params.size,
      .views = params.views,
      .lights = params.lights,
      .provenance = {.source = SourceOf(params),
                     // Given images keep their own licence, which only the caller knows.
                     .licence = is_heightmap ? "" : "CC0-1.0",
                     .citation = is_heightmap ? "Ray-traced by Tessera from given height and colour images"
                                              : absl::StrCat("Tessera, procedural material ", params.kind,
                                                             ", seed ", params.seed)},
      .radiometry =
          absl::StrCat("pi f_r cos(theta_i) of the texel's footprint on the reference plane, traced with ",
                       params.area_samples, " area samples and ", params.bounces,
                       " diffuse bounces; linear sRGB primaries")};
  const TraceOptions options{.area_samples = params.area_samples,
                             .bounces = params.bounces,
                             .seed = Mix64(params.seed, 0x6d65736fULL)};
  return TraceHeightField(std::move(maps), std::move(info), options, context);
}

}  // namespace

std::vector<std::string_view> GeneratorKinds() {
  return {"reactdiffuse", "holes", "wrinkles", "weave", kHeightmap};
}

absl::Status CheckGenerateParams(const GenerateParams& params) {
  const auto kinds = GeneratorKinds();
  if (std::find(kinds.begin(), kinds.end(), params.kind) == kinds.end()) {
    std::string known;
    for (const std::string_view kind : kinds) {
      known += (known.empty() ? "" : ", ") + std::string(kind);
    }
    return absl::InvalidArgumentError(
        absl::StrCat("generator kind \"", params.kind, "\", expected one of ", known));
  }
  TESSERA_RETURN_IF_ERROR(ValidateRange("size", params.size, kMinSize, kMaxSize));
  TESSERA_RETURN_IF_ERROR(ValidateDirections("view", params.views));
  TESSERA_RETURN_IF_ERROR(ValidateDirections("light", params.lights));
  TESSERA_RETURN_IF_ERROR(ValidateRange("area samples", params.area_samples, 1, kMaxAreaSamples));
  TESSERA_RETURN_IF_ERROR(ValidateRange("bounces", params.bounces, 0, kMaxBounces));
  const bool is_heightmap = params.kind == kHeightmap;
  // An image's range is its own; MapsFromImages bounds what the scale makes of it.
  if (!std::isfinite(params.height_scale_texels) || params.height_scale_texels < 0.0 ||
      (!is_heightmap && params.height_scale_texels > params.size / 4.0)) {
    return absl::InvalidArgumentError(absl::StrCat("height scale ", params.height_scale_texels,
                                                   " texels, expected 0 to size / 4 = ", params.size / 4.0));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<BtfSource>> GenerateBtf(const GenerateParams& params,
                                                       const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckGenerateParams(params));
  TESSERA_RETURN_IF_ERROR(ValidateImages(params));
  try {
    return Generate(params, context);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        absl::StrCat("generating ", params.size, "x", params.size, ": out of memory"));
  }
}

}  // namespace tessera
