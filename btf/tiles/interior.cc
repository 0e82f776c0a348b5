#include "btf/tiles/interior.h"

#include <algorithm>

#include "btf/base/status_macros.h"

namespace tessera {

namespace {

// The texels on a canvas whose border row and placed features stay.
Canvas CanvasOfTile(const Exemplar& exemplar, int size, const std::vector<PlacedFeature>& placed,
                    std::span<const uint32_t> texels) {
  Canvas canvas(exemplar, size, size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) {
      if (const uint32_t texel = texels[static_cast<size_t>(y) * size + x]; texel != kNoTexel) {
        canvas.Set(x, y, texel);
      }
      if (x == 0 || y == 0 || x == size - 1 || y == size - 1) {
        canvas.Fix(x, y);
      }
    }
  }
  for (const PlacedFeature& feature : placed) {
    for (const PlacedTexel& at : feature) {
      canvas.Place(at.x, at.y, at.texel);
    }
  }
  return canvas;
}

}  // namespace

absl::Status LayInterior(const Exemplar& exemplar, int size, const std::vector<PlacedFeature>& placed,
                         const FillParams& params, const RunContext& context, Filler& filler,
                         std::span<uint32_t> texels, FillReport& report) {
  Canvas canvas = CanvasOfTile(exemplar, size, placed, texels);
  for (const PlacedFeature& feature : placed) {
    filler.LayAround(feature, params.feature_size / 2, canvas, report);
  }
  TESSERA_RETURN_IF_ERROR(filler.LayEmpty(params, context, canvas, report));
  std::copy(canvas.texels().begin(), canvas.texels().end(), texels.begin());
  return absl::OkStatus();
}

absl::Status ImproveInterior(const Exemplar& exemplar, int size, const std::vector<PlacedFeature>& placed,
                             const FillParams& params, const RunContext& context, Filler& filler,
                             std::span<uint32_t> texels, FillReport& report) {
  Canvas canvas = CanvasOfTile(exemplar, size, placed, texels);
  TESSERA_RETURN_IF_ERROR(filler.Improve(params, context, canvas, report));
  std::copy(canvas.texels().begin(), canvas.texels().end(), texels.begin());
  return absl::OkStatus();
}

}  // namespace tessera
