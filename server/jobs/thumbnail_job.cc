#include "server/jobs/thumbnail_job.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>

#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"
#include "btf/render/composite.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dress.h"
#include "btf/wang/tile_set.h"

namespace tessera {
namespace {

constexpr int kSquareQuads = 2;          // along a side
constexpr double kFrameOfSquare = 0.99;  // so that no pixel of the frame lies at the square's edge
constexpr uint32_t kMostScale = 16;      // pixels drawn along the side of one that is kept

// [-1, 1] x [-1, 1] x 0, facing +z.
QuadMesh Square() {
  QuadMesh mesh;
  for (int y = 0; y <= kSquareQuads; ++y) {
    for (int x = 0; x <= kSquareQuads; ++x) {
      mesh.positions.emplace_back(2.0F * static_cast<float>(x) / kSquareQuads - 1.0F,
                                  2.0F * static_cast<float>(y) / kSquareQuads - 1.0F, 0.0F);
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
  }
  for (uint32_t y = 0; y < kSquareQuads; ++y) {
    for (uint32_t x = 0; x < kSquareQuads; ++x) {
      const uint32_t corner = (kSquareQuads + 1) * y + x;
      mesh.quads.push_back({corner, corner + 1, corner + kSquareQuads + 2, corner + kSquareQuads + 1});
    }
  }
  return mesh;
}

// A pixel for each block of scale x scale.
Image MeansOfBlocks(const Image& image, int scale) {
  Image means(image.width / scale, image.height / scale, image.channels);
  const float share = 1.0F / static_cast<float>(scale * scale);
  for (int y = 0; y < means.height * scale; ++y) {
    for (int x = 0; x < means.width * scale; ++x) {
      for (int channel = 0; channel < image.channels; ++channel) {
        means.at(x / scale, y / scale)[channel] += share * image.at(x, y)[channel];
      }
    }
  }
  return means;
}

}  // namespace

absl::StatusOr<JobOutput> RunThumbnailJob(const JobInput& input, const JobContext& context) {
  if (input.inputs.size() != 1) {
    return absl::InternalError("a thumbnail job takes one blob");
  }
  TESSERA_ASSIGN_OR_RETURN(std::string bytes, context.blobs->ReadAll(input.inputs[0], kMaxContainerBytes));
  TESSERA_ASSIGN_OR_RETURN(const TileSet tile_set, ParseTileSet(std::as_bytes(std::span(bytes))));
  std::string().swap(bytes);
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* const arrangement, FindArrangement(tile_set.arrangement_id));
  // A picture shows breaks rather than refusing them.
  const DressParams params{.allow_breaks = true, .target_quads = kSquareQuads * kSquareQuads};
  TESSERA_ASSIGN_OR_RETURN(const DressResult dressed, DressMesh(Square(), *arrangement, params, context.run));
  PreviewScene scene{.dressing = &dressed.dressing, .tile_set = &tile_set};
  scene.width = scene.height = kThumbnailSide;
  scene.camera.eye = {0.0, 0.0, kFrameOfSquare / std::tan(0.5 * scene.camera.fov_y_rad)};
  const uint32_t scale =
      std::min(kMostScale, std::bit_ceil(static_cast<uint32_t>(std::ceil(TexelsPerPixel(scene)))));
  scene.width = scene.height = kThumbnailSide * static_cast<int>(scale);
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<OffscreenContext> gl, CreateOsmesaContext());
  TESSERA_ASSIGN_OR_RETURN(const Image covered, RenderGl(*gl, scene, context.run));
  TESSERA_ASSIGN_OR_RETURN(const Image picture, CompositeOver(covered, Background{}));
  TESSERA_ASSIGN_OR_RETURN(std::string png, EncodePng(MeansOfBlocks(picture, static_cast<int>(scale))));
  return JobOutput{std::move(png), v1::TileSet()};
}

}  // namespace tessera
