// What mip levels do for objects far away: the RMSE of a picture against one of 8 x 8 times as many pixels,
// averaged, over pixels that the object covers wholly; without levels and with them, at several distances.
//
//   mips_bench                          a generated material, encoded and synthesised on the way
//   mips_bench OUT TILESET.tsra..       other tile sets; the pictures lie in the folder OUT
//
// Prints `name,value,unit,limit,verdict`; exits 1 when a limit is missed: from 16 texels a pixel on, with
// levels at most half the error that there is without.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/codec/codec.h"
#include "btf/data/direction_sets.h"
#include "btf/image/image_io.h"
#include "btf/meso/generate.h"
#include "btf/mips/tile_mips.h"
#include "btf/render/composite.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "btf/tiles/synthesize.h"
#include "btf/wang/dress.h"
#include "btf/wang/shapes.h"
#include "tests/bench/bench_line.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kWidth = 160;
constexpr int kHeight = 120;
constexpr int kFiner = 8;
// Silhouettes and faces' outlines stay, so less is asked for than a plane would give.
constexpr double kMostOfError = 0.5;
constexpr double kTexelsOfLimit = 16.0;  // along a pixel's side

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The mean over kFiner x kFiner pixels, weighted by coverage.
Image Averaged(const Image& fine) {
  Image mean(fine.width / kFiner, fine.height / kFiner, 4);
  for (int y = 0; y < mean.height; ++y) {
    for (int x = 0; x < mean.width; ++x) {
      std::array<double, 4> sum = {};
      for (int i = 0; i < kFiner * kFiner; ++i) {
        const float* const from = fine.at(x * kFiner + i % kFiner, y * kFiner + i / kFiner);
        for (int c = 0; c < 3; ++c) {
          sum[c] += static_cast<double>(from[c]) * from[3];
        }
        sum[3] += from[3];
      }
      for (int c = 0; c < 3 && sum[3] > 0.0; ++c) {
        mean.at(x, y)[c] = static_cast<float>(sum[c] / sum[3]);
      }
      mean.at(x, y)[3] = static_cast<float>(sum[3] / (kFiner * kFiner));
    }
  }
  return mean;
}

// Over pixels covered wholly in both.
double Rmse(const Image& image, const Image& reference) {
  double squares = 0.0;
  int64_t samples = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const float* const a = image.at(x, y);
      const float* const b = reference.at(x, y);
      if (a[3] == 1.0F && b[3] == 1.0F) {
        for (int c = 0; c < 3; ++c) {
          squares += (a[c] - b[c]) * (a[c] - b[c]);
        }
        samples += 3;
      }
    }
  }
  return samples > 0 ? std::sqrt(squares / static_cast<double>(samples)) : 0.0;
}

class MipsBench {
 public:
  MipsBench(OffscreenContext& context, std::filesystem::path folder)
      : context_(context), folder_(std::move(folder)) {}

  // Whether every limit holds.
  bool Measure(const std::string& name, const TileSet& tile_set) {
    const auto start = Clock::now();
    const TileMips mips = Must(MakeTileMips(tile_set, {}, {}));
    Print(name + "_make", SecondsSince(start), "s", 0.0);
    Print(name + "_bytes", static_cast<double>(mips.size_bytes()), "bytes", 0.0);
    for (size_t l = 0; l < mips.levels.size(); ++l) {
      Print(absl::StrCat(name, "_level_", l + 1, "_rmse"), mips.levels[l].quantisation_rmse, "reflectance",
            0.0);
    }
    bool ok = true;
    const bool is_plane = tile_set.arrangement_id.starts_with("plane");
    for (const std::string shape : {is_plane ? "plane" : "genus3", "torus"}) {
      const QuadMesh mesh = Must(BuiltinShape(shape));
      const Dressing dressing =
          Must(DressMesh(mesh, *Must(FindArrangement(tile_set.arrangement_id)), {.allow_breaks = true}, {}))
              .dressing;
      const auto without = Must(GlPreview::Create(context_, dressing, tile_set));
      const auto with = Must(GlPreview::Create(context_, dressing, tile_set, &mips));
      for (const int distance : {1, 2, 4, 8}) {
        PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set};
        scene.camera = FramingCamera(dressing.mesh, kWidth, kHeight);
        // A plane is seen aslant, so that it reaches far away.
        const Eigen::Vector3d back = scene.camera.eye - scene.camera.target;
        const Eigen::Vector3d aslant = is_plane && shape == "plane"
                                           ? Eigen::Vector3d(0.0, -1.5 * back.norm(), 0.0)
                                           : Eigen::Vector3d(0.0, 0.0, 0.0);
        scene.camera.eye = scene.camera.target + distance * (back + aslant);
        ok &= MeasureAt(absl::StrCat(name, "_", shape, "_", distance), scene, *without, *with, mips);
      }
    }
    return ok;
  }

 private:
  bool MeasureAt(const std::string& name, PreviewScene scene, GlPreview& without, GlPreview& with,
                 const TileMips& mips) {
    scene.width = kWidth * kFiner;
    scene.height = kHeight * kFiner;
    const Image reference = Averaged(Must(without.Render(scene, {})));
    scene.width = kWidth;
    scene.height = kHeight;
    const Image off = Must(without.Render(scene, {}));
    auto start = Clock::now();
    (void)Must(without.Render(scene, {}));
    const double off_seconds = SecondsSince(start);
    scene.mips = &mips;
    const Image on = Must(with.Render(scene, {}));
    start = Clock::now();
    (void)Must(with.Render(scene, {}));
    Print(name + "_seconds_by_those_without", SecondsSince(start) / off_seconds, "ratio", 0.0);
    const double texels = TexelsPerPixel(scene);
    Print(name + "_texels", texels, "texels/pixel", 0.0);
    const double off_rmse = Rmse(off, reference);
    const double on_rmse = Rmse(on, reference);
    Print(name + "_without_rmse", off_rmse, "reflectance", 0.0);
    Save(name + "-reference", reference);
    Save(name + "-without", off);
    Save(name + "-with", on);
    return Print(name + "_with_rmse", on_rmse, "reflectance",
                 texels >= kTexelsOfLimit ? kMostOfError * off_rmse : 0.0);
  }

  void Save(const std::string& name, const Image& image) const {
    if (!folder_.empty()) {
      const std::string bytes = Must(EncodePng(Must(CompositeOver(image, Background{}))));
      std::ofstream(folder_ / (name + ".png"), std::ios::binary) << bytes;
    }
  }

  OffscreenContext& context_;
  std::filesystem::path folder_;
};

TileSet GeneratedTileSet() {
  const std::vector<Direction> directions = Must(DirectionSet("5x8"));
  const std::unique_ptr<BtfSource> source = Must(GenerateBtf(
      {.kind = "reactdiffuse", .size = 64, .views = directions, .lights = directions, .seed = 1}, {}));
  const Material material = Must(FindCodec("dfmf")->Encode(*source, {.rank = 24}, {}));
  return Must(SynthesizeTileSet(material, *Must(FindArrangement("plane-16")),
                                {.tile_size = 32, .strip_height = 12, .force = true}, {}));
}

int Run(std::span<char*> arguments) {
  std::printf("name,value,unit,limit,verdict\n");
  const std::unique_ptr<OffscreenContext> context = Must(CreateOsmesaContext());
  if (arguments.empty()) {
    return MipsBench(*context, {}).Measure("reactdiffuse", GeneratedTileSet()) ? 0 : 1;
  }
  MipsBench bench(*context, arguments[0]);
  bool ok = true;
  for (char* const path : arguments.subspan(1)) {
    std::ifstream file(path, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    ok &= bench.Measure(std::filesystem::path(path).stem().string(),
                        Must(ParseTileSet(std::as_bytes(std::span(bytes)))));
  }
  return ok ? 0 : 1;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  return tessera::Run(std::span(argv, argc).subspan(1));
}
