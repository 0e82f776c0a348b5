#include "btf/tiles/edges.h"

#include <algorithm>

#include "btf/base/status_macros.h"

namespace tessera {

absl::Status SynthesizeStrip(const ExemplarSpectra& spectra, const Corners& corners,
                             const std::vector<PlacedFeature>& placed, int strip_index, int tile_size,
                             const FillParams& params, const RunContext& context, Strip& strip) {
  const Exemplar& exemplar = spectra.exemplar();
  const int height = corners.strip_height;
  const int half = height / 2;
  Canvas canvas(exemplar, tile_size, height);
  const Patch start = corners.sample(strip_index, StripEnd::kStart);
  const Patch end = corners.sample(strip_index, StripEnd::kEnd);
  const auto place = [&](const Patch& patch, int first_x) {
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < half; ++x) {
        canvas.Set(first_x + x, y, exemplar.TexelAt(patch.turn, patch.u + x, patch.v + y));
        canvas.Fix(first_x + x, y);
      }
    }
  };
  place(start, 0);
  place(end, tile_size - half);

  for (const PlacedFeature& feature : placed) {
    for (const PlacedTexel& at : feature) {
      canvas.Place(at.x, at.y, at.texel);
    }
  }

  Filler filler(spectra);
  for (const PlacedFeature& feature : placed) {
    filler.LayAround(feature, half, canvas, strip.report);
  }
  int right_of_start = std::min(tile_size - height, exemplar.TurnedWidth(start.turn) - (start.u + half));
  while (right_of_start > 0 &&
         !spectra.MayBring({start.turn, start.u + half, start.v}, right_of_start, height)) {
    --right_of_start;
  }
  if (right_of_start > 0) {
    filler.Lay({half, 0, right_of_start, height}, {start.turn, start.u + half, start.v}, canvas,
               strip.report);
  }
  int left_of_end = std::min(tile_size - height, end.u);
  while (left_of_end > 0 && !spectra.MayBring({end.turn, end.u - left_of_end, end.v}, left_of_end, height)) {
    --left_of_end;
  }
  if (left_of_end > 0) {
    filler.Lay({tile_size - half - left_of_end, 0, left_of_end, height},
               {end.turn, end.u - left_of_end, end.v}, canvas, strip.report);
  }
  TESSERA_RETURN_IF_ERROR(filler.Fill(params, context, canvas, strip.report));
  strip.width = tile_size;
  strip.height = height;
  strip.texels = canvas.texels();
  return absl::OkStatus();
}

}  // namespace tessera
