// A fully covered 640x480 frame of every codec: what a further picture of a prepared preview costs, with one
// texel a pixel and bilinear, against its limit; making it ready, and the first picture with its shaders,
// once; the same under light from all around in the frequency domain and, of "dsh" 25x25, as 50 lights with
// shadows. Errors are against the reference. Beside the median of the wall clock stands the least processor
// time by the number of cores, which others on the machine hardly change, and what bounds it: the fetches of
// BTFels and factors a pixel, counted in the shaders, and what one took; of 50 lights as many pictures under
// one. Prints `name,value,unit,limit,verdict`; exits 1 when a limit is missed.
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/codec/codec.h"
#include "btf/light/generated_environment.h"
#include "btf/light/q2_tree.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "btf/render/reference.h"
#include "tests/bench/bench_line.h"
#include "tests/bench/repeated_row.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/codec_preview.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kRounds = 9;
constexpr int kTilesAcross = 32;
constexpr int kTileSize = 64;
constexpr int kBtfels = 12000;  // as many as `surface-96` keeps of a 128 x 128 material
constexpr double kTexelsPerPixel = 0.7;
constexpr int kEnvironmentLights = 50;
constexpr double kLitNearest = 8.0;  // seconds
constexpr double kLitBilinear = 20.0;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// Of all threads of this process, by the number of cores.
double ProcessorSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return (seconds(usage.ru_utime) + seconds(usage.ru_stime)) / std::thread::hardware_concurrency();
}

// An encoding of few texels, its BTFels as many as a tile set's and at random: speed does not depend on them.
BtfelTable EncodedBtfels(std::string_view codec, const EncodeParams& params) {
  SampledBtf btf = ShinyBtf(16, 8, bench::Ubo81(), bench::Ubo81());
  absl::StatusOr<Material> material = FindCodec(codec)->Encode(btf, params, {});
  if (!material.ok()) {
    std::fprintf(stderr, "%s\n", material.status().ToString().c_str());
    std::exit(1);
  }
  BtfelTable table = std::move(material->btfels);
  table.codes.resize(static_cast<size_t>(kBtfels) * table.num_coefficients);
  Rng rng(5);
  for (uint8_t& code : table.codes) {
    code = static_cast<uint8_t>(rng.NextBelow(256));
  }
  return table;
}

// A plane that fills the frame with about `texels` texels a pixel, its BTFels in runs as tiles have them.
struct Frame {
  Frame(BtfelTable btfels, double texels)
      : dressing(testing::RandomDressing(testing::SkewedGrid(kTilesAcross, 0.0, 1), 2)),
        tile_set(testing::RandomTileSet(std::move(btfels), kTileSize, 4)) {
    for (size_t i = 0; i < tile_set.tile_index.size(); ++i) {
      // Verbatim patches of 16 texels, one turn each.
      const auto patch = static_cast<uint32_t>(Mix64(i / 16) % (kBtfels - 16));
      tile_set.tile_index[i] =
          PackTexel(patch + static_cast<uint32_t>(i % 16), static_cast<int>(Mix64(i / 16, 1) % 4));
    }
    scene.dressing = &dressing;
    scene.tile_set = &tile_set;
    // Seen from straight above: the plane is 2 units wide.
    const double units_per_pixel = texels * 2.0 / (kTilesAcross * kTileSize);
    const double height = units_per_pixel * scene.height;
    scene.camera.eye = {0.0, 0.0, 0.5 * height / std::tan(0.5 * scene.camera.fov_y_rad)};
  }
  Frame(const Frame&) = delete;
  Frame& operator=(const Frame&) = delete;

  Dressing dressing;
  TileSet tile_set;
  PreviewScene scene;
};

struct Cost {
  double wall = 0.0;       // median seconds
  double processor = 0.0;  // least seconds
};

// Of a further picture; exits when it fails or does not cover the frame.
Cost TimePicture(GlPreview& preview, const PreviewScene& scene) {
  std::vector<double> wall;
  std::vector<double> processor;
  for (int round = 0; round < kRounds; ++round) {
    const auto start = Clock::now();
    const double processor_start = ProcessorSeconds();
    const absl::StatusOr<Image> image = preview.Render(scene, {});
    processor.push_back(ProcessorSeconds() - processor_start);
    wall.push_back(SecondsSince(start));
    if (!image.ok() || image->at(0, 0)[3] != 1.0f ||
        image->at(scene.width - 1, scene.height - 1)[3] != 1.0f) {
      std::fprintf(stderr, "%s\n",
                   image.ok() ? "the frame is not covered" : image.status().ToString().c_str());
      std::exit(1);
    }
  }
  std::ranges::sort(wall);
  return {wall[wall.size() / 2], *std::ranges::min_element(processor)};
}

std::unique_ptr<GlPreview> Prepare(OffscreenContext& context, const Frame& frame) {
  absl::StatusOr<std::unique_ptr<GlPreview>> preview =
      GlPreview::Create(context, frame.dressing, frame.tile_set);
  if (!preview.ok()) {
    std::fprintf(stderr, "%s\n", preview.status().ToString().c_str());
    std::exit(1);
  }
  return *std::move(preview);
}

// `fetches` a pixel; 0 where they are not counted.
bool PrintCost(const std::string& name, const Cost& cost, double limit, int fetches) {
  Print(name + "_processor", cost.processor, "s", 0.0);
  if (fetches > 0) {
    constexpr double kPixels = 640.0 * 480.0;
    Print(name + "_fetches", fetches, "a pixel", 0.0);
    Print(name + "_fetch", 1e9 * cost.wall / (fetches * kPixels), "ns", 0.0);
  }
  return Print(name, cost.wall, "s", limit);
}

// Of a codec's shaders, a pixel: one tap, bilinear, bilinear under 25 harmonics.
struct Fetches {
  int nearest = 0;
  int bilinear = 0;
  int sky = 0;
};
constexpr Fetches kDshFetches = {.nearest = 250, .bilinear = 1000, .sky = 1000};  // 25x25

// A light's or a view's direction lies between three nodes. Groups are of eight coefficients: `luma` of them
// have a texel for each node of the pair, or for each harmonic at a node of the view; `chroma` of them two.
// Two luma groups, or both of chroma, share one under the 21 harmonics above degree 1.
Fetches DfmfFetches(const BtfelTable& table) {
  constexpr int kPairs = 9;
  constexpr int kViews = 3;
  constexpr int kTaps = 4;
  constexpr int kGroup = 8;
  const auto luma_rank = static_cast<int>(table.tables.at("luma").shape.back());
  const int luma = (luma_rank + kGroup - 1) / kGroup;
  const int chroma = (table.num_coefficients - luma_rank + kGroup - 1) / kGroup;
  return {.nearest = kPairs * (luma + 2 * chroma) + luma + chroma,
          .bilinear = kPairs * (luma + 2 * chroma) + kTaps * (luma + chroma),
          .sky = kViews * ((2 * 4 + 21) * (luma / 2 + chroma) + 25 * (luma % 2)) + kTaps * (luma + chroma)};
}

// Of its colours, all pixels covered.
double RootMeanSquare(const Image& image) {
  double squares = 0.0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        squares += static_cast<double>(image.at(x, y)[c]) * image.at(x, y)[c];
      }
    }
  }
  return std::sqrt(squares / (3.0 * image.width * image.height));
}

// Limits in seconds, 0 for none.
bool TimeCodec(OffscreenContext& context, const std::string& name, BtfelTable btfels, double nearest_limit,
               double bilinear_limit, double sky_limit, const Fetches& fetches) {
  Frame frame(std::move(btfels), kTexelsPerPixel);
  auto start = Clock::now();
  std::unique_ptr<GlPreview> preview = Prepare(context, frame);
  (void)preview->Render(frame.scene, {});
  Print(name + "_first_with_shaders", SecondsSince(start), "s", 0.0);
  preview.reset();
  start = Clock::now();
  preview = Prepare(context, frame);
  Print(name + "_prepare", SecondsSince(start), "s", 0.0);
  bool ok = true;
  for (const Filter filter : {Filter::kNearest, Filter::kBilinear}) {
    const bool is_nearest = filter == Filter::kNearest;
    frame.scene.filter = filter;
    ok &= PrintCost(name + (is_nearest ? "_nearest" : "_bilinear"), TimePicture(*preview, frame.scene),
                    is_nearest ? nearest_limit : bilinear_limit,
                    is_nearest ? fetches.nearest : fetches.bilinear);
  }
  // Light from all around alone, in the frequency domain, bilinear.
  const FrequencyLight sky = testing::RandomFrequencyLight(25, 6);
  PreviewScene under_sky = frame.scene;
  under_sky.lights.clear();
  under_sky.frequency_light = &sky;
  start = Clock::now();
  (void)preview->Render(under_sky, {});
  Print(name + "_sky_first_with_shaders", SecondsSince(start), "s", 0.0);
  ok &= PrintCost(name + "_sky", TimePicture(*preview, under_sky), sky_limit, fetches.sky);
  PreviewScene small = frame.scene;
  small.width = 160;
  small.height = 120;
  const ReferencePicture reference = Must(RenderReferenceWithDepth(small, {}));
  ok &= Print(name + "_rmse",
              testing::CompareAwayFromSilhouettes(Must(preview->Render(small, {})), reference).rmse,
              "reflectance", 0.5 / 255.0);
  small.lights.clear();
  small.frequency_light = &sky;
  const ReferencePicture sky_reference = Must(RenderReferenceWithDepth(small, {}));
  ok &= Print(name + "_sky_rmse",
              testing::CompareAwayFromSilhouettes(Must(preview->Render(small, {})), sky_reference).rmse /
                  RootMeanSquare(sky_reference.image),
              "of the picture", 1e-3);
  return ok;
}

int Run() {
  std::printf("name,value,unit,limit,verdict\n");
  auto context = CreateOsmesaContext();
  if (!context.ok()) {
    std::fprintf(stderr, "%s\n", context.status().ToString().c_str());
    return 1;
  }
  std::fprintf(stderr, "%s\n", (*context)->Description().c_str());
  constexpr double kDshNearest = 0.15;
  constexpr double kDshBilinear = 0.5;
  constexpr double kSky = 0.3;  // 25 harmonics
  const auto dsh = [] { return testing::RandomBtfels(kBtfels, 25, 25, 3, testing::BasisKind::kOrthonormal); };
  bool ok = TimeCodec(**context, "dsh_25x25", dsh(), kDshNearest, kDshBilinear, kSky, kDshFetches);
  for (const int rank : {24, 48}) {
    BtfelTable btfels = EncodedBtfels("dfmf", {.rank = rank});
    const Fetches fetches = DfmfFetches(btfels);
    ok &= TimeCodec(**context, absl::StrCat("dfmf_", rank), std::move(btfels), kDshNearest / 3.0,
                    kDshBilinear / 3.0, kSky, fetches);
  }
  ok &= TimeCodec(**context, "view-pca_5", EncodedBtfels("view-pca", {.eigen_textures = 5}), 0.0, 0.0, kSky,
                  {});

  // Hardly any decoding: what all codecs' pictures cost beside it.
  ok &= TimeCodec(**context, "dsh_1x1", testing::RandomBtfels(kBtfels, 1, 1, 3), 0.0, 0.0, 0.0, {});

  // An environment as lights with shadows: the bound is as many pictures under one light.
  Frame lit(dsh(), kTexelsPerPixel);
  lit.scene.shadows = ShadowParams{};
  lit.scene.lights = DirectionalLights(*Q2Tree(*GeneratedEnvironment("studio")).Lights(kEnvironmentLights));
  const std::unique_ptr<GlPreview> lit_preview = Prepare(**context, lit);
  for (const Filter filter : {Filter::kNearest, Filter::kBilinear}) {
    lit.scene.filter = filter;
    const bool is_nearest = filter == Filter::kNearest;
    const std::string name =
        absl::StrCat("dsh_25x25_50_lights_shadows_", is_nearest ? "nearest" : "bilinear");
    const auto start = Clock::now();
    (void)lit_preview->Render(lit.scene, {});
    ok &= Print(name, SecondsSince(start), "s", is_nearest ? kLitNearest : kLitBilinear);
    PreviewScene single = lit.scene;
    single.shadows.reset();
    single.lights.resize(1);
    Print(name + "_as_many_pictures", kEnvironmentLights * TimePicture(*lit_preview, single).wall, "s", 0.0);
  }

  const Frame minified(dsh(), 2.5);
  PrintCost("dsh_25x25_minified", TimePicture(*Prepare(**context, minified), minified.scene), 0.0, 0);
  return ok ? 0 : 1;
}

}  // namespace
}  // namespace tessera

int main() {
  return tessera::Run();
}
