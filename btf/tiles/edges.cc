#include "btf/tiles/edges.h"

#include <algorithm>
#include <limits>
#include <mutex>
#include <span>
#include <utility>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace {

constexpr int kCornerSets = 4;     // that strips are made for
constexpr int kTries = 4;          // at each strip
constexpr int kMiddleWeight = 16;  // of seams between the two middle rows

// Of all seams. Those between the two middle rows lie in two tiles each, for good: what the tiles are filled
// with later mends the others.
int64_t CostOfStrip(const Canvas& canvas) {
  int64_t cost = 0;
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x) {
      const bool is_border = y == canvas.height() / 2 - 1;
      cost += canvas.right_cost(x, y) + (is_border ? kMiddleWeight : 1) * canvas.down_cost(x, y);
    }
  }
  return cost;
}

// Of what a tile has before its inside is laid: four corners and half of four strips.
double CostOfEdges(const Corners& corners, std::span<const Strip> strips) {
  const double corner = CostOfMismatch(corners.cost) * corners.strip_height / 2;
  double mean_strip = 0.0;
  for (const Strip& strip : strips) {
    mean_strip += static_cast<double>(strip.cost) / static_cast<double>(strips.size());
  }
  return 4.0 * corner + 2.0 * mean_strip;
}

}  // namespace

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
  strip.cost = CostOfStrip(canvas);
  return absl::OkStatus();
}

absl::StatusOr<Edges> SynthesizeEdges(const ExemplarSpectra& spectra, const Arrangement& arrangement,
                                      const std::vector<Corners>& corner_sets, const Controls& controls,
                                      int tile_size, const FillParams& params, const RunContext& context) {
  const auto num_sets = std::min<size_t>(kCornerSets, corner_sets.size());
  const auto num_strips = static_cast<size_t>(NumStrips(arrangement));
  const size_t total = num_sets * num_strips * kTries;
  std::vector<Strip> tried(total);  // [set][strip][try]
  std::vector<absl::Status> statuses(total);
  std::mutex mutex;
  int64_t done = 0;
  ParallelFor(context, 0, static_cast<int64_t>(total), 1, [&](int64_t begin, int64_t) {
    const auto strip = static_cast<int>(begin / kTries % num_strips);
    FillParams fill = params;
    fill.seed = Mix64(params.seed, static_cast<uint64_t>(begin));
    fill.turns = TurnsOfStrip(arrangement, strip);
    statuses[begin] =
        SynthesizeStrip(spectra, corner_sets[begin / kTries / num_strips], controls.on_strip(strip), strip,
                        tile_size, fill, context, tried[begin]);
    const std::lock_guard lock(mutex);
    context.Report("strips", ++done, static_cast<int64_t>(total), "tries");
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  for (const absl::Status& status : statuses) {
    TESSERA_RETURN_IF_ERROR(status);
  }
  Edges best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (size_t set = 0; set < num_sets; ++set) {
    std::vector<Strip> strips;
    for (size_t strip = 0; strip < num_strips; ++strip) {
      const auto tries = std::span(tried).subspan((set * num_strips + strip) * kTries, kTries);
      strips.push_back(*std::ranges::min_element(tries, {}, &Strip::cost));
    }
    if (const double cost = CostOfEdges(corner_sets[set], strips); cost < best_cost) {
      best_cost = cost;
      best = {corner_sets[set], std::move(strips)};
    }
  }
  return best;
}

}  // namespace tessera
