// A fully covered 640x480 frame of 25x25 double spherical harmonics: RenderGl against its limit, split into
// its parts, and against the cheapest picture of the same frame, one texel a pixel. Prints
// `name,value,unit,limit,verdict`; exits 1 when a limit is missed.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "btf/codec/codec.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "btf/render/reference.h"
#include "tests/btf/render/hand_made.h"

namespace {

using namespace tessera;  // NOLINT: a program of its own
using Clock = std::chrono::steady_clock;

constexpr int kRounds = 7;
constexpr double kLimitSeconds = 0.8;
constexpr int kTilesAcross = 32;
constexpr int kBtfels = 12000;  // as many as `surface-96` keeps of a 128 x 128 material

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double Median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

bool Print(const char* name, double value, const char* unit, double limit) {
  const bool ok = limit <= 0.0 || value <= limit;
  if (limit > 0.0) {
    std::printf("%s,%.4g,%s,%.4g,%s\n", name, value, unit, limit, ok ? "ok" : "MISSED");
  } else {
    std::printf("%s,%.4g,%s,,\n", name, value, unit);
  }
  return ok;
}

// A plane that fills the frame with about `texels` texels a pixel, its BTFels in runs as tiles have them.
struct Frame {
  Frame(double texels, int tile_size)
      : dressing(testing::RandomDressing(testing::SkewedGrid(kTilesAcross, 0.0, 1), 2)),
        tile_set(testing::RandomTileSet(testing::RandomBtfels(kBtfels, 25, 25, 3), tile_size, 4)) {
    for (size_t i = 0; i < tile_set.tile_index.size(); ++i) {
      // Verbatim patches of 16 texels, one turn each.
      const auto patch = static_cast<uint32_t>(Mix64(i / 16) % (kBtfels - 16));
      tile_set.tile_index[i] =
          PackTexel(patch + static_cast<uint32_t>(i % 16), static_cast<int>(Mix64(i / 16, 1) % 4));
    }
    scene.dressing = &dressing;
    scene.tile_set = &tile_set;
    // Seen from straight above: the plane is 2 units wide.
    const double units_per_pixel = texels * 2.0 / (kTilesAcross * tile_size);
    const double height = units_per_pixel * scene.height;
    scene.camera.eye = {0.0, 0.0, 0.5 * height / std::tan(0.5 * scene.camera.fov_y_rad)};
  }
  Dressing dressing;
  TileSet tile_set;
  PreviewScene scene;
};

// Median seconds of RenderGl; 0 when it fails or does not cover the frame.
double TimePicture(OffscreenContext& context, const PreviewScene& scene) {
  std::vector<double> seconds;
  for (int round = 0; round < kRounds; ++round) {
    const auto start = Clock::now();
    const auto image = RenderGl(context, scene, RunContext{});
    seconds.push_back(SecondsSince(start));
    if (!image.ok()) {
      std::fprintf(stderr, "%s\n", image.status().ToString().c_str());
      return 0.0;
    }
    const float* corner = image->at(0, 0);
    if (corner[3] != 1.0f || image->at(scene.width - 1, scene.height - 1)[3] != 1.0f) {
      std::fprintf(stderr, "the frame is not covered\n");
      return 0.0;
    }
  }
  return Median(seconds);
}

}  // namespace

int main() {
  std::printf("name,value,unit,limit,verdict\n");
  auto context = CreateOsmesaContext();
  if (!context.ok()) {
    std::fprintf(stderr, "%s\n", context.status().ToString().c_str());
    return 1;
  }
  std::fprintf(stderr, "%s\n", (*context)->Description().c_str());
  bool ok = true;

  Frame frame(0.7, 64);
  auto start = Clock::now();
  if (!RenderGl(**context, frame.scene, RunContext{}).ok()) {
    return 1;
  }
  const double first = SecondsSince(start);
  const double bilinear = TimePicture(**context, frame.scene);
  ok &= bilinear > 0.0;
  ok &= Print("preview_640x480_bilinear", bilinear, "s", kLimitSeconds);
  Print("preview_first_with_shaders", first, "s", 0.0);

  // Where the time goes: the tables are made and uploaded even for a picture in the dark.
  start = Clock::now();
  const auto glsl = FindCodec(frame.tile_set.btfels.codec_id)->Glsl(frame.tile_set.btfels);
  Print("preview_pack_btfels", SecondsSince(start), "s", 0.0);
  PreviewScene dark = frame.scene;
  dark.lights = {{.place = {0.0, 0.0, -1.0}}};
  Print("preview_all_but_decoding", TimePicture(**context, dark), "s", 0.0);

  Frame minified(2.5, 64);
  const double four_texels = TimePicture(**context, minified.scene);
  ok &= four_texels > 0.0;
  Print("preview_minified", four_texels, "s", 0.0);

  // The peer: one texel a pixel, the least that a picture of this codec must decode.
  PreviewScene unfiltered = frame.scene;
  unfiltered.filter = Filter::kNearest;
  const double nearest = TimePicture(**context, unfiltered);
  Print("preview_nearest", nearest, "s", 0.0);
  Print("preview_bilinear_by_nearest", bilinear / nearest, "ratio", 0.0);

  PreviewScene small = frame.scene;
  small.width = 160;
  small.height = 120;
  start = Clock::now();
  const auto reference = RenderReferenceWithDepth(small, RunContext{});
  const double reference_seconds = SecondsSince(start);
  const auto image = RenderGl(**context, small, RunContext{});
  if (!image.ok() || !reference.ok()) {
    return 1;
  }
  ok &= Print("preview_rmse", testing::CompareAwayFromSilhouettes(*image, *reference).rmse, "reflectance",
              1.0 / 255.0);
  Print("reference_160x120", reference_seconds, "s", 0.0);
  return ok ? 0 : 1;
}
