#include "btf/chart/lighting_chart.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/light/frequency_light.h"
#include "btf/light/q2_tree.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "btf/render/reference.h"
#include "btf/report/page.h"
#include "btf/wang/shapes.h"

namespace tessera {
namespace {

constexpr char kLightingCodec[] = "dsh";
constexpr char kLightingArrangement[] = "chart";

struct LightingPlan {
  int width = 0;
  int height = 0;
  int environment_height = 0;
  std::vector<int> lights;
  std::vector<int> orders;
  int shown_lights = 0;  // of the pictures
  int shown_order = 0;
};

LightingPlan LightingPlanOf(ChartSize size) {
  if (size == ChartSize::kQuick) {
    return {.width = 24,
            .height = 18,
            .environment_height = 12,
            .lights = {8, 64},
            .orders = {2, 5},
            .shown_lights = 64,
            .shown_order = 5};
  }
  return {.width = 96,
          .height = 72,
          .environment_height = 32,
          .lights = {8, 16, 32, 64, 128, 256, 512, 1000},
          .orders = {2, 3, 4, 5, 6, 7},
          .shown_lights = 64,
          .shown_order = 5};
}

// The middle of the material as the one tile of a torus.
struct DressedTorus {
  TileSet tile_set;
  Dressing dressing;
};

absl::StatusOr<DressedTorus> DressTorus(const Material& material) {
  constexpr int kMostTile = 64;
  DressedTorus torus;
  TileSet& tile_set = torus.tile_set;
  tile_set.arrangement_id = kLightingArrangement;
  tile_set.tile_size = std::min({material.width, material.height, kMostTile});
  tile_set.tile_codes = {0};
  tile_set.btfels = material.btfels;
  const int left = (material.width - tile_set.tile_size) / 2;
  const int top = (material.height - tile_set.tile_size) / 2;
  for (int y = top; y < top + tile_set.tile_size; ++y) {
    for (int x = left; x < left + tile_set.tile_size; ++x) {
      tile_set.tile_index.push_back(PackTexel(static_cast<uint32_t>(y * material.width + x), 0));
    }
  }
  TESSERA_ASSIGN_OR_RETURN(torus.dressing.mesh, BuiltinShape("torus"));
  torus.dressing.arrangement_id = kLightingArrangement;
  torus.dressing.tile.assign(torus.dressing.mesh.quads.size(), 0);
  torus.dressing.turns.assign(torus.dressing.mesh.quads.size(), 0);
  return torus;
}

double RelativeError(const Image& image, const Image& truth) {
  double difference = 0.0;
  double signal = 0.0;
  for (size_t pixel = 0; pixel < truth.pixels.size(); pixel += 4) {
    if (truth.pixels[pixel + 3] != 1.0F) {
      continue;
    }
    for (size_t i = pixel; i < pixel + 3; ++i) {
      difference += std::pow(static_cast<double>(image.pixels[i]) - truth.pixels[i], 2);
      signal += std::pow(static_cast<double>(truth.pixels[i]), 2);
    }
  }
  return signal > 0.0 ? std::sqrt(difference / signal) : 0.0;
}

double PeakOf(const Environment& environment) {
  const auto luminance = [](const Eigen::Array3d& rgb) {
    return rgb.matrix().dot(Eigen::Vector3d(0.2126, 0.7152, 0.0722));
  };
  double most = 0.0;
  for (int y = 0; y < environment.grid().height(); ++y) {
    for (int x = 0; x < environment.grid().width(); ++x) {
      most = std::max(most, luminance(environment.TexelRadiance(x, y)));
    }
  }
  const double mean = luminance(environment.MeanRadiance());
  return mean > 0.0 ? most / mean : 0.0;
}

// The charts of one material.
class LightingRun {
 public:
  LightingRun(const DressedTorus& torus, GlPreview& preview, const LightingPlan& plan,
              size_t num_environments, const RunContext& context)
      : preview_(preview),
        plan_(plan),
        context_(context),
        total_(num_environments * (2 + 2 * plan.lights.size() + plan.orders.size())) {
    scene_.dressing = &torus.dressing;
    scene_.tile_set = &torus.tile_set;
    scene_.width = plan.width;
    scene_.height = plan.height;
  }

  absl::Status SetCamera() {
    TESSERA_ASSIGN_OR_RETURN(scene_.camera,
                             OrbitCamera(scene_.dressing->mesh,
                                         {.azimuth_rad = RadFromDeg(25.0), .elevation_rad = RadFromDeg(35.0)},
                                         plan_.width, plan_.height));
    return absl::OkStatus();
  }

  absl::StatusOr<double> OneLightSeconds() {
    TESSERA_RETURN_IF_ERROR(Draw().status());
    return seconds_;
  }

  absl::StatusOr<LightingEnvironment> Chart(const NamedEnvironment& named) {
    const Environment environment = Reduced(named.environment, plan_.environment_height);
    LightingEnvironment charted{
        .name = named.name, .height = plan_.environment_height, .peak = PeakOf(environment)};
    scene_.lights.clear();
    TESSERA_ASSIGN_OR_RETURN(const Image truth, Truth(environment, /*has_shadows=*/false));
    TESSERA_ASSIGN_OR_RETURN(const Image shadowed, Truth(environment, /*has_shadows=*/true));
    charted.shadow_cost = RelativeError(truth, shadowed);
    charted.pictures = {{"every texel, shadows", shadowed}, {"every texel", truth}};
    const auto add = [&](LightingMethod method, int count, bool is_shown) -> absl::Status {
      TESSERA_ASSIGN_OR_RETURN(Image image, Draw());
      charted.points.push_back({.method = method,
                                .count = count,
                                .seconds = seconds_,
                                .error = RelativeError(image, truth),
                                .shadowed_error = RelativeError(image, shadowed)});
      if (is_shown) {
        charted.pictures.push_back(
            {absl::StrCat(kLightingMethodNames[static_cast<size_t>(method)], ", ", count), std::move(image)});
      }
      return Step();
    };
    const Q2Tree tree(environment);
    for (const LightingMethod method : {LightingMethod::kShadowedLights, LightingMethod::kLights}) {
      if (method == LightingMethod::kShadowedLights) {
        scene_.shadows = ShadowParams{};
      } else {
        scene_.shadows.reset();
      }
      for (const int count : plan_.lights) {
        TESSERA_ASSIGN_OR_RETURN(const std::vector<EnvironmentLight> lights, tree.Lights(count));
        scene_.lights = DirectionalLights(lights);
        TESSERA_RETURN_IF_ERROR(add(method, count, count == plan_.shown_lights));
      }
    }
    scene_.lights.clear();
    for (const int order : plan_.orders) {
      TESSERA_ASSIGN_OR_RETURN(const FrequencyLight light,
                               FrequencyLight::Create(environment, order * order));
      scene_.frequency_light = &light;
      const absl::Status added = add(LightingMethod::kFrequency, order, order == plan_.shown_order);
      scene_.frequency_light = nullptr;
      TESSERA_RETURN_IF_ERROR(added);
    }
    return charted;
  }

 private:
  // A picture, and in seconds_ its time, the least of two; of many lights, which fewer have compiled the
  // shaders for, of one.
  absl::StatusOr<Image> Draw() {
    constexpr size_t kManyLights = 100;
    const RunContext quiet{.stop = context_.stop};
    const int rounds = scene_.lights.size() > kManyLights ? 1 : 2;
    if (rounds > 1) {
      TESSERA_RETURN_IF_ERROR(preview_.Render(scene_, quiet).status());
    }
    absl::StatusOr<Image> image;
    seconds_ = 1e300;
    for (int round = 0; round < rounds; ++round) {
      const auto start = std::chrono::steady_clock::now();
      image = preview_.Render(scene_, quiet);
      TESSERA_RETURN_IF_ERROR(image.status());
      seconds_ =
          std::min(seconds_, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    }
    return image;
  }

  absl::StatusOr<Image> Truth(const Environment& environment, bool has_shadows) {
    PreviewScene scene = scene_;
    scene.shadows = has_shadows ? std::optional(ShadowParams{}) : std::nullopt;
    TESSERA_ASSIGN_OR_RETURN(
        ReferencePicture picture,
        RenderReferenceWithDepth(scene, {.stop = context_.stop, .num_threads = context_.num_threads},
                                 {.environment = &environment}));
    TESSERA_RETURN_IF_ERROR(Step());
    return std::move(picture.image);
  }

  absl::Status Step() {
    context_.Report("chart", ++done_, total_, "pictures");
    return context_.CheckStop();
  }

  GlPreview& preview_;
  const LightingPlan& plan_;
  const RunContext& context_;
  PreviewScene scene_;
  double seconds_ = 0.0;
  uint64_t done_ = 0;
  uint64_t total_;
};

}  // namespace

absl::StatusOr<LightingChart> ChartLighting(const std::string& name, BtfSource& source,
                                            const std::vector<NamedEnvironment>& environments, ChartSize size,
                                            OffscreenContext& gl, const RunContext& context) {
  if (environments.empty()) {
    return absl::InvalidArgumentError("a chart of lighting needs an environment");
  }
  const LightingPlan plan = LightingPlanOf(size);
  TESSERA_ASSIGN_OR_RETURN(const Material material, FindCodec(kLightingCodec)->Encode(source, {}, context));
  TESSERA_ASSIGN_OR_RETURN(const DressedTorus torus, DressTorus(material));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<GlPreview> preview,
                           GlPreview::Create(gl, torus.dressing, torus.tile_set));
  LightingChart chart{.name = name, .codec = kLightingCodec, .width = plan.width, .height = plan.height};
  LightingRun run(torus, *preview, plan, environments.size(), context);
  TESSERA_RETURN_IF_ERROR(run.SetCamera());
  TESSERA_ASSIGN_OR_RETURN(chart.one_light_s, run.OneLightSeconds());
  for (const NamedEnvironment& environment : environments) {
    TESSERA_ASSIGN_OR_RETURN(chart.environments.emplace_back(), run.Chart(environment));
  }
  return chart;
}

std::string LightingCsv(const std::vector<LightingChart>& charts) {
  std::string csv = CsvLine({"source", "environment", "peak", "method", "count", "seconds", "by_one_light",
                             "error", "shadowed_error"});
  const auto text = [](double value) { return absl::StrCat(value); };
  for (const LightingChart& chart : charts) {
    for (const LightingEnvironment& environment : chart.environments) {
      for (const LightingPoint& point : environment.points) {
        csv += CsvLine({chart.name, environment.name, text(environment.peak),
                        kLightingMethodNames[static_cast<size_t>(point.method)], absl::StrCat(point.count),
                        text(point.seconds), text(point.seconds / chart.one_light_s), text(point.error),
                        text(point.shadowed_error)});
      }
    }
  }
  return csv;
}

}  // namespace tessera
