#include "btf/tiles/index_maps.h"

#include <algorithm>
#include <mutex>

#include <absl/strings/str_format.h>

#include "btf/base/parallel.h"
#include "btf/base/reason.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/tiles/diamonds.h"
#include "btf/tiles/frames.h"
#include "btf/tiles/interior.h"
#include "btf/tiles/pattern.h"

namespace tessera {
namespace {

constexpr int kSmallestExemplar = 32;
// The BTFel number of a packed texel has 30 bits; tiles of 16,384 texels are far beyond any use.
constexpr int kLargestTile = 16384;
constexpr int kTilesAtOnce = 4;  // laid without knowing each other

// Of a window of a tile. Strips are few and every tile shows them, so that they are worth more.
constexpr int ImprovedCandidates(int num_candidates) {
  return (5 * num_candidates + 7) / 8;
}

enum SeedStage : uint64_t { kCornerSeed = 1, kStripSeed = 2, kTileSeed = 3 };

absl::Status CheckReached(const FillReport& report, const SynthesisParams& params, absl::string_view what) {
  if (report.reached || params.force) {
    return absl::OkStatus();
  }
  return WithReason(absl::FailedPreconditionError(
                        absl::StrFormat("%s: after %d patches the mean mismatch along its seams is %.2f mean "
                                        "steps (limit %.2f), the largest %.2f "
                                        "times the distance of two texels drawn at random (limit %.2f)",
                                        what, report.num_patches, report.mean_mismatch, params.mean_threshold,
                                        report.largest_mismatch, params.texel_threshold)),
                    "THRESHOLD_NOT_REACHED");
}

// A first window of every turn that may be asked for fits somewhere: it is square, so one turn stands for
// all.
absl::Status CheckExcluded(const ExemplarSpectra& spectra, const SynthesisParams& params) {
  const int side = FirstWindowSide(spectra, params.strip_height);
  if (spectra.MayBring(spectra.NextAllowed({0, 0, 0}, side, side, 0, 0), side, side)) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrFormat(
      "features that are only placed leave no %dx%d texels of the %dx%d exemplar for synthesis", side, side,
      spectra.exemplar().width(), spectra.exemplar().height()));
}

}  // namespace

absl::Status CheckSizes(int exemplar_width, int exemplar_height, const SynthesisParams& params) {
  const int height = params.strip_height;
  if (height < kSmallestStrip || height % 2 != 0) {
    return absl::InvalidArgumentError(
        absl::StrFormat("strip height %d: must be even and at least %d", height, kSmallestStrip));
  }
  if (params.tile_size < 2 * height || params.tile_size > kLargestTile) {
    return absl::InvalidArgumentError(absl::StrFormat("tile size %d: must be in [%d, %d] for strips %d high",
                                                      params.tile_size, 2 * height, kLargestTile, height));
  }
  if (!(params.mean_threshold > 0.0) || !(params.texel_threshold > 0.0)) {
    return absl::InvalidArgumentError(absl::StrFormat("thresholds %g and %g: must be above 0",
                                                      params.mean_threshold, params.texel_threshold));
  }
  if (params.num_candidates < 1) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%d candidates: must be at least 1", params.num_candidates));
  }
  if (params.effort < 1 || params.effort > kMostEffort) {
    return absl::InvalidArgumentError(
        absl::StrFormat("effort %d: must be in [1, %d]", params.effort, kMostEffort));
  }
  if (params.method != SynthesisMethod::kFrame) {
    return CheckDiamondSizes(exemplar_width, exemplar_height, params);
  }
  const int needed = std::max(kSmallestExemplar, 2 * height);
  if (exemplar_width < needed || exemplar_height < needed) {
    return WithReason(absl::InvalidArgumentError(
                          absl::StrFormat("material %dx%d: strips %d high need at least %dx%d texels",
                                          exemplar_width, exemplar_height, height, needed, needed)),
                      "MATERIAL_TOO_SMALL");
  }
  return absl::OkStatus();
}

absl::StatusOr<IndexMaps> SynthesizeIndexMaps(const Exemplar& exemplar, const Arrangement& arrangement,
                                              const SynthesisParams& params, const RunContext& context,
                                              const Controls& controls) {
  TESSERA_RETURN_IF_ERROR(CheckSizes(exemplar.width(), exemplar.height(), params));
  if (params.method != SynthesisMethod::kFrame) {
    return SynthesizeDiamonds(exemplar, arrangement, params, context);
  }
  const int num_tiles = static_cast<int>(arrangement.codes.size());
  const int num_strips = NumStrips(arrangement);
  const int size = params.tile_size;
  const size_t tile_area = static_cast<size_t>(size) * size;

  std::vector<int> turns = TurnsOfInterior(arrangement);
  for (int strip = 0; strip < num_strips; ++strip) {
    for (const int turn : TurnsOfStrip(arrangement, strip)) {
      if (std::find(turns.begin(), turns.end(), turn) == turns.end()) {
        turns.push_back(turn);
      }
    }
  }
  const ExemplarSpectra spectra(exemplar, turns, RegionSide(exemplar, params.strip_height), context,
                                controls.excluded);
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  TESSERA_RETURN_IF_ERROR(CheckExcluded(spectra, params));

  context.Report("corners", 0, 1, "sets");
  TESSERA_ASSIGN_OR_RETURN(const std::vector<Corners> corner_sets,
                           ChooseCorners(spectra, arrangement, params.strip_height,
                                         Mix64(params.seed, kCornerSeed), context, controls.corners));
  context.Report("corners", 1, 1, "sets");

  const auto fill_params = [&](SeedStage stage) {
    FillParams fill;
    fill.feature_size = params.strip_height;
    fill.seed = Mix64(params.seed, stage);
    fill.mean_threshold = params.mean_threshold;
    fill.texel_threshold = params.texel_threshold;
    fill.num_candidates = params.num_candidates;
    fill.effort = params.effort;
    return fill;
  };

  TESSERA_ASSIGN_OR_RETURN(Edges edges, SynthesizeEdges(spectra, arrangement, corner_sets, controls, size,
                                                        fill_params(kStripSeed), context));
  const Corners& corners = edges.corners;
  IndexMaps maps{.tile_size = size,
                 .texels = std::vector<uint32_t>(tile_area * num_tiles, kNoTexel),
                 .strips = std::move(edges.strips),
                 .tile_reports = std::vector<FillReport>(num_tiles)};
  for (const CornerCut& cut : corners.cuts) {
    maps.corner_cost += cut.cost;
  }
  maps.corner_seams = static_cast<int64_t>(corners.cuts.size());

  std::mutex mutex;
  int done = 0;
  const auto count_one = [&](std::string_view stage, std::string_view unit, int total) {
    const std::lock_guard lock(mutex);
    context.Report(stage, ++done, total, unit);
  };
  for (int strip = 0; strip < num_strips; ++strip) {
    TESSERA_RETURN_IF_ERROR(
        CheckReached(maps.strips[strip].report, params, absl::StrFormat("strip %d", strip)));
  }

  // So that tiles do not repeat each other, and do not depend on the number of threads: they are laid some at
  // once, each knowing those that were laid before these, and one that turns out to repeat another is laid
  // anew; then all are improved, which is most of the work, each knowing the others as they were laid.
  UsageMap usage(exemplar.width(), exemplar.height());
  const auto texels_of = [&](int tile) {
    return std::span(maps.texels).subspan(tile * tile_area, tile_area);
  };
  const int margin = params.strip_height / 2;
  const std::vector<int> turns_of_tiles = TurnsOfTiles(arrangement);
  const auto tile_params = [&](int tile, const Siblings& siblings) {
    FillParams fill = fill_params(kTileSeed);
    fill.seed = Mix64(fill.seed, static_cast<uint64_t>(tile));
    fill.turns = TurnsOfInterior(arrangement);
    fill.usage = &usage;
    fill.siblings = &siblings;
    return fill;
  };
  std::vector<absl::Status> statuses(num_tiles);
  const auto first_tiles = [&](int count) {
    return std::span<const uint32_t>(maps.texels).first(count * tile_area);
  };
  // Knowing the first `num_known` tiles.
  const auto lay = [&](int tile, int num_known) {
    std::ranges::copy(BuildFrame(arrangement, arrangement.SidesOf(tile), corners, maps.strips),
                      texels_of(tile).begin());
    const Siblings siblings(first_tiles(num_known), size, margin, tile, turns_of_tiles);
    Filler filler(spectra);
    statuses[tile] = LayInterior(exemplar, size, controls.on_tile(tile), tile_params(tile, siblings), context,
                                 filler, texels_of(tile), maps.tile_reports[tile]);
  };
  for (int first = 0; first < num_tiles; first += kTilesAtOnce) {
    const int end = std::min(num_tiles, first + kTilesAtOnce);
    ParallelFor(context, first, end, 1, [&](int64_t begin, int64_t) {
      lay(static_cast<int>(begin), first);
      count_one("laying", "tiles", num_tiles);
    });
    for (int tile = first; tile < end; ++tile) {
      TESSERA_RETURN_IF_ERROR(context.CheckStop());
      if (Siblings(first_tiles(tile), size, margin, tile, turns_of_tiles).Repeats(texels_of(tile))) {
        lay(tile, tile);
      }
      TESSERA_RETURN_IF_ERROR(statuses[tile]);
      // Insides only: how often a strip is shown is the arrangement's affair.
      for (int y = margin; y < size - margin; ++y) {
        usage.Count(texels_of(tile).subspan(static_cast<size_t>(y) * size + margin, size - 2 * margin));
      }
    }
    usage.Finish();
  }
  const std::vector<uint32_t> laid = maps.texels;
  done = 0;
  statuses.assign(num_tiles, absl::OkStatus());
  ParallelFor(context, 0, num_tiles, 1, [&](int64_t begin, int64_t) {
    const int tile = static_cast<int>(begin);
    const Siblings siblings(laid, size, margin, tile, turns_of_tiles);
    Filler filler(spectra);
    FillParams fill = tile_params(tile, siblings);
    fill.num_candidates = ImprovedCandidates(params.num_candidates);
    statuses[tile] = ImproveInterior(exemplar, size, controls.on_tile(tile), fill, context, filler,
                                     texels_of(tile), maps.tile_reports[tile]);
    count_one("tiles", "tiles", num_tiles);
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  for (int tile = 0; tile < num_tiles; ++tile) {
    TESSERA_RETURN_IF_ERROR(statuses[tile]);
    TESSERA_RETURN_IF_ERROR(
        CheckReached(maps.tile_reports[tile], params,
                     absl::StrFormat("tile %d (code %d)", tile, arrangement.codes[tile])));
  }
  return maps;
}

}  // namespace tessera
