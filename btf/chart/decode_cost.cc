#include "btf/chart/decode_cost.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "btf/base/cpu_time.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"

namespace tessera {
namespace {

// The decoded values end here, so that no compiler takes the work away.
volatile double g_checksum = 0.0;

absl::StatusOr<double> LeastThreadSeconds(const std::function<void(int round)>& work,
                                          const RunContext& context) {
  double least = std::numeric_limits<double>::infinity();
  for (int round = 0; round < kDecodeRounds; ++round) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const double start = ThreadCpuSeconds();
    work(round);
    least = std::min(least, ThreadCpuSeconds() - start);
  }
  return least;
}

// One tile that is the whole material, a small one several times, laid repeats x repeats times over a plane
// of [-1, 1]^2.
struct PlaneOfTexels {
  TileSet tile_set;
  Dressing dressing;
  int repeats = 0;
};

PlaneOfTexels MakePlane(const Material& material) {
  constexpr char kName[] = "chart";
  constexpr int kLeastTile = 64;  // so that a small texture does not take many faces
  const int w = std::min(material.width, material.height);
  PlaneOfTexels plane;
  TileSet& tile_set = plane.tile_set;
  tile_set.arrangement_id = kName;
  tile_set.tile_size = w * ((kLeastTile + w - 1) / w);
  tile_set.tile_codes = {0};
  tile_set.btfels = material.btfels;
  for (int y = 0; y < tile_set.tile_size; ++y) {
    for (int x = 0; x < tile_set.tile_size; ++x) {
      tile_set.tile_index.push_back(PackTexel(static_cast<uint32_t>(y % w * material.width + x % w), 0));
    }
  }
  // One more than fills the frame.
  const int repeats =
      static_cast<int>(std::ceil(kFrameWidth * kFrameTexelsPerPixel / tile_set.tile_size)) + 1;
  plane.repeats = repeats;
  Dressing& dressing = plane.dressing;
  dressing.arrangement_id = kName;
  const auto place = [&](int i) { return 2.0F * static_cast<float>(i) / static_cast<float>(repeats) - 1.0F; };
  for (int j = 0; j <= repeats; ++j) {
    for (int i = 0; i <= repeats; ++i) {
      dressing.mesh.positions.emplace_back(place(i), place(j), 0.0F);
      dressing.mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
  }
  for (int j = 0; j < repeats; ++j) {
    for (int i = 0; i < repeats; ++i) {
      const auto v = static_cast<uint32_t>(j * (repeats + 1) + i);
      const auto above = v + static_cast<uint32_t>(repeats) + 1;
      dressing.mesh.quads.push_back({v, v + 1, above + 1, above});
    }
  }
  dressing.tile.assign(dressing.mesh.quads.size(), 0);
  dressing.turns.assign(dressing.mesh.quads.size(), 0);
  return plane;
}

absl::StatusOr<double> LeastFrameSeconds(GlPreview& preview, const PreviewScene& scene,
                                         const RunContext& run_context) {
  // The first picture also compiles the shaders.
  TESSERA_RETURN_IF_ERROR(preview.Render(scene, run_context).status());
  constexpr int kMostRounds = 3;
  constexpr double kEnoughSeconds = 0.4;
  double least = std::numeric_limits<double>::infinity();
  double spent = 0.0;
  for (int round = 0; round < kMostRounds && spent < kEnoughSeconds; ++round) {
    const auto start = std::chrono::steady_clock::now();
    TESSERA_ASSIGN_OR_RETURN(const Image image, preview.Render(scene, run_context));
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    if (image.at(0, 0)[3] != 1.0F || image.at(scene.width - 1, scene.height - 1)[3] != 1.0F) {
      return absl::InternalError("the plane does not cover the frame");
    }
    least = std::min(least, seconds);
    spent += seconds;
  }
  return least;
}

}  // namespace

absl::StatusOr<CpuDecodeCost> MeasureCpuDecode(const Material& material, const RunContext& context) {
  const BtfelTable& table = material.btfels;
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table));
  struct Query {
    size_t texel = 0;
    Eigen::Vector3d light;
    Eigen::Vector3d view;
  };
  constexpr int kQueries = 512;
  constexpr double kLargestThetaRad = 1.3;  // within the measured angles
  Rng rng(1);
  std::vector<Query> queries(kQueries);
  for (Query& query : queries) {
    query.texel = rng.NextBelow(table.size());
    for (Eigen::Vector3d* direction : {&query.light, &query.view}) {
      const double theta = kLargestThetaRad * rng.NextDouble();
      *direction = VectorFromDirection({theta, 2.0 * kPi * rng.NextDouble()});
    }
  }
  CpuDecodeCost cost;
  double sum = 0.0;
  TESSERA_ASSIGN_OR_RETURN(const double random, LeastThreadSeconds(
                                                    [&](int) {
                                                      for (const Query& q : queries) {
                                                        sum += decoder->Decode(table.btfel(q.texel), q.light,
                                                                               q.view, 0)[0];
                                                      }
                                                    },
                                                    context));
  cost.random_s = random / kQueries;
  // Pictures enough that the clock's steps do not count.
  constexpr size_t kLeastTexels = 50'000;
  const size_t pictures = (kLeastTexels + table.size() - 1) / table.size();
  std::vector<float> rgb(table.size() * 3);
  TESSERA_ASSIGN_OR_RETURN(const double streaming,
                           LeastThreadSeconds(
                               [&](int round) {
                                 for (size_t i = 0; i < pictures; ++i) {
                                   const Query& q = queries[(round * pictures + i) % kQueries];
                                   decoder->DecodeTexels(table.codes, q.light, q.view, 0, rgb);
                                   sum += rgb[rgb.size() / 2];
                                 }
                               },
                               context));
  cost.streaming_s = streaming / static_cast<double>(pictures * table.size());
  g_checksum = sum;
  return cost;
}

absl::StatusOr<GlFrameCost> MeasureGlFrame(OffscreenContext& context, const Material& material,
                                           const RunContext& run_context) {
  RunContext quiet = run_context;
  quiet.progress = nullptr;
  const PlaneOfTexels plane = MakePlane(material);
  PreviewScene scene{.dressing = &plane.dressing, .tile_set = &plane.tile_set};
  scene.width = kFrameWidth;
  scene.height = kFrameHeight;
  const double unit_per_pixel =
      kFrameTexelsPerPixel * 2.0 / (static_cast<double>(plane.repeats) * plane.tile_set.tile_size);
  scene.camera.eye = {0.0, 0.0, 0.5 * unit_per_pixel * kFrameHeight / std::tan(0.5 * scene.camera.fov_y_rad)};
  GlFrameCost cost;
  const auto start = std::chrono::steady_clock::now();
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<GlPreview> preview,
                           GlPreview::Create(context, plane.dressing, plane.tile_set));
  cost.prepare_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  TESSERA_ASSIGN_OR_RETURN(cost.bilinear_s, LeastFrameSeconds(*preview, scene, quiet));
  scene.filter = Filter::kNearest;
  TESSERA_ASSIGN_OR_RETURN(cost.nearest_s, LeastFrameSeconds(*preview, scene, quiet));
  return cost;
}

}  // namespace tessera
