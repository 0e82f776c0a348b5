#include "btf/tiles/diamonds.h"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <span>
#include <utility>

#include <absl/strings/str_format.h>

#include "btf/base/parallel.h"
#include "btf/base/reason.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/tiles/frames.h"
#include "btf/tiles/tile_sides.h"

namespace tessera {
namespace {

constexpr int kDrawsAtOnce = 32;

// One sample for every strip.
using Samples = std::vector<Patch>;

Samples DrawSamples(const Exemplar& exemplar, const Arrangement& arrangement, int tile_size, Rng& rng) {
  Samples samples;
  for (int strip = 0; strip < NumStrips(arrangement); ++strip) {
    const std::vector<int> turns = TurnsOfStrip(arrangement, strip);
    const int turn = turns[rng.NextBelow(turns.size())];
    const auto u = static_cast<int>(rng.NextBelow(exemplar.TurnedWidth(turn) - tile_size + 1));
    const auto v = static_cast<int>(rng.NextBelow(exemplar.TurnedHeight(turn) - tile_size + 1));
    samples.push_back({turn, u, v});
  }
  return samples;
}

// Texel of a sample at (along, depth) of a side that shows it.
uint32_t SampleTexel(const Exemplar& exemplar, const Samples& samples, const CornerSide& shown, int side,
                     int along, int depth, int tile_size) {
  const StripTexel at = StripTexelAt(side, shown.sign, along, depth, tile_size, tile_size);
  const Patch& patch = samples[shown.strip];
  return TurnTexel(exemplar.TexelAt(patch.turn, patch.u + at.x, patch.v + at.y), at.turns);
}

// The corner of a tile whose side `out` lies to the south and whose side `in` lies to the west.
uint32_t OutSample(const Exemplar& exemplar, const Samples& samples, const CornerPair& pair, int i, int j,
                   int tile_size) {
  return SampleTexel(exemplar, samples, pair.out, 0, i, j, tile_size);
}

uint32_t InSample(const Exemplar& exemplar, const Samples& samples, const CornerPair& pair, int i, int j,
                  int tile_size) {
  return SampleTexel(exemplar, samples, pair.in, 3, tile_size - 1 - j, i, tile_size);
}

Overlap OverlapOf(const Exemplar& exemplar, const Samples& samples, const CornerPair& pair,
                  const SynthesisParams& params) {
  const int side = params.tile_size / 2;
  Overlap overlap{.side = side, .reach = params.strip_height / 2, .out = {}, .in = {}};
  for (int j = 0; j <= side; ++j) {
    for (int i = 0; i <= side; ++i) {
      overlap.out.push_back(j < side ? OutSample(exemplar, samples, pair, i, j, params.tile_size) : kNoTexel);
      overlap.in.push_back(i < side ? InSample(exemplar, samples, pair, i, j, params.tile_size) : kNoTexel);
    }
  }
  return overlap;
}

// d of one set: the largest over its overlaps.
double LargestError(const Exemplar& exemplar, const std::vector<CornerPair>& pairs, const Samples& samples,
                    const SynthesisParams& params) {
  const int side = params.tile_size / 2;
  const int reach = params.strip_height / 2;
  double largest = 0.0;
  for (const CornerPair& pair : pairs) {
    double sum = 0.0;
    int count = 0;
    for (int j = 0; j < side; ++j) {
      for (int i = std::max(0, j - reach + 1); i < std::min(side, j + reach); ++i) {
        const double distance = exemplar.Distance(OutSample(exemplar, samples, pair, i, j, params.tile_size),
                                                  InSample(exemplar, samples, pair, i, j, params.tile_size));
        sum += distance * distance;
        ++count;
      }
    }
    largest = std::max(largest, sum / count);
  }
  return largest / (exemplar.spread() * exemplar.spread());
}

absl::StatusOr<Samples> ChooseSamples(const Exemplar& exemplar, const Arrangement& arrangement,
                                      const std::vector<CornerPair>& pairs, const SynthesisParams& params,
                                      const RunContext& context, DiamondReport& report) {
  const int num_draws = params.diamonds.num_draws;
  report.overlap_error = std::numeric_limits<double>::infinity();
  Samples best;
  for (int first = 0; first < num_draws && !report.accepted; first += kDrawsAtOnce) {
    context.Report("samples", first, num_draws, "draws");
    const int count = std::min(kDrawsAtOnce, num_draws - first);
    std::vector<Samples> drawn(count);
    std::vector<double> errors(count);
    ParallelFor(context, 0, count, 1, [&](int64_t i, int64_t) {
      Rng rng(Mix64(params.seed, static_cast<uint64_t>(first + i)));
      drawn[i] = DrawSamples(exemplar, arrangement, params.tile_size, rng);
      errors[i] = LargestError(exemplar, pairs, drawn[i], params);
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    for (int i = 0; i < count && !report.accepted; ++i) {
      ++report.num_draws;
      if (errors[i] < report.overlap_error) {
        report.overlap_error = errors[i];
        best = std::move(drawn[i]);
      }
      report.accepted = report.overlap_error < params.diamonds.largest_error;
    }
  }
  context.Report("samples", num_draws, num_draws, "draws");
  return best;
}

Strip StripOfSample(const Exemplar& exemplar, const Patch& sample, int tile_size) {
  Strip strip{.width = tile_size, .height = tile_size, .texels = {}, .report = {}};
  for (int y = 0; y < tile_size; ++y) {
    for (int x = 0; x < tile_size; ++x) {
      strip.texels.push_back(exemplar.TexelAt(sample.turn, sample.u + x, sample.v + y));
    }
  }
  strip.report.reached = true;  // one piece of the exemplar
  return strip;
}

FillReport MeasureTile(const Exemplar& exemplar, std::span<const uint32_t> texels,
                       const SynthesisParams& params) {
  Canvas canvas(exemplar, params.tile_size, params.tile_size);
  for (int y = 0; y < params.tile_size; ++y) {
    for (int x = 0; x < params.tile_size; ++x) {
      canvas.Set(x, y, texels[static_cast<size_t>(y) * params.tile_size + x]);
    }
  }
  FillParams thresholds;
  thresholds.mean_threshold = params.mean_threshold;
  thresholds.texel_threshold = params.texel_threshold;
  return MeasureCanvas(canvas, thresholds);
}

}  // namespace

OverlapCut CutByPath(const Exemplar& exemplar, const Overlap& overlap) {
  const int side = overlap.side;
  // The path runs between texels: point (i, j) is the corner at which texel (i, j) begins. `out` shows below
  // and to the right of it, `in` above and to the left. It begins above the vertex texel.
  constexpr int64_t kFar = std::numeric_limits<int64_t>::max() / 2;
  const auto index = [&](int i, int j) { return overlap.Index(i, j); };
  const auto along_i = [&](int i, int j) {  // from (i, j) to (i + 1, j)
    return PairCost(exemplar, overlap.out[index(i, j - 1)], overlap.in[index(i, j)], GridCut::kUp);
  };
  const auto along_j = [&](int i, int j) {  // from (i, j) to (i, j + 1)
    return PairCost(exemplar, overlap.in[index(i - 1, j)], overlap.out[index(i, j)], GridCut::kRight);
  };
  const size_t num_points = static_cast<size_t>(side + 1) * (side + 1);
  std::vector<int64_t> cost(num_points, kFar);
  std::vector<uint8_t> came_along_i(num_points, 0);
  cost[index(1, 1)] = along_i(0, 1);
  for (int j = 1; j <= side; ++j) {
    for (int i = 1; i <= side; ++i) {
      if (std::abs(i - j) > overlap.reach) {
        continue;
      }
      int64_t& here = cost[index(i, j)];
      if (j > 1 && cost[index(i, j - 1)] < kFar) {
        here = std::min(here, cost[index(i, j - 1)] + along_j(i, j - 1));
      }
      if (i > 1 && cost[index(i - 1, j)] < kFar) {
        const int64_t through = cost[index(i - 1, j)] + along_i(i - 1, j);
        came_along_i[index(i, j)] = through < here ? 1 : 0;
        here = std::min(here, through);
      }
    }
  }
  OverlapCut cut{.in_wins = std::vector<uint8_t>(static_cast<size_t>(side) * side, 0),
                 .cost = cost[index(side, side)]};
  const auto fill_column = [&](int i, int from_j) {
    for (int j = from_j; j < side; ++j) {
      cut.in_wins[static_cast<size_t>(j) * side + i] = 1;
    }
  };
  fill_column(0, 1);
  for (int i = side, j = side; i > 1 || j > 1;) {
    if (came_along_i[index(i, j)] != 0) {
      --i;
      fill_column(i, j);
    } else {
      --j;
    }
  }
  return cut;
}

OverlapCut CutByMinimum(const Exemplar& exemplar, const Overlap& overlap) {
  const int side = overlap.side;
  const auto index = [&](int i, int j) { return overlap.Index(i, j); };
  // Source side shows `out`, sink side `in`; grid rows are j, so that grid down is up in the picture.
  GridCut grid(side, side);
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      const uint32_t out = overlap.out[index(i, j)];
      const uint32_t in = overlap.in[index(i, j)];
      const auto set_edge = [&](GridCut::Direction in_grid, GridCut::Direction direction, size_t other) {
        grid.SetEdge(i, j, in_grid, PairCost(exemplar, out, overlap.in[other], direction),
                     PairCost(exemplar, in, overlap.out[other], direction));
      };
      if (i + 1 < side) {
        set_edge(GridCut::kRight, GridCut::kRight, index(i + 1, j));
      } else {
        grid.AddTerminals(i, j, PairCost(exemplar, in, overlap.out[index(side, j)], GridCut::kRight), 0);
      }
      if (j + 1 < side) {
        set_edge(GridCut::kDown, GridCut::kUp, index(i, j + 1));
      } else {
        grid.AddTerminals(i, j, 0, PairCost(exemplar, out, overlap.in[index(i, side)], GridCut::kUp));
      }
      if (j == 0 || i - j >= overlap.reach) {
        grid.AddTerminals(i, j, GridCut::kPinned, 0);
      } else if (i == 0 || j - i >= overlap.reach) {
        grid.AddTerminals(i, j, 0, GridCut::kPinned);
      }
    }
  }
  OverlapCut cut;
  cut.cost = grid.Solve();
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      cut.in_wins.push_back(grid.OnSourceSide(i, j) ? 0 : 1);
    }
  }
  return cut;
}

absl::Status CheckDiamondSizes(int exemplar_width, int exemplar_height, const SynthesisParams& params) {
  const int size = params.tile_size;
  if (size % 2 != 0) {
    return absl::InvalidArgumentError(absl::StrFormat("tile size %d: must be even for diamonds", size));
  }
  if (params.diamonds.num_draws < 1 || !(params.diamonds.largest_error > 0.0)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%d draws of diamonds, errors below %g: must be above 0", params.diamonds.num_draws,
                        params.diamonds.largest_error));
  }
  if (exemplar_width < size || exemplar_height < size) {
    return WithReason(absl::InvalidArgumentError(
                          absl::StrFormat("material %dx%d: diamonds of tiles of %d need as many texels",
                                          exemplar_width, exemplar_height, size)),
                      "MATERIAL_TOO_SMALL");
  }
  return absl::OkStatus();
}

absl::StatusOr<IndexMaps> SynthesizeDiamonds(const Exemplar& exemplar, const Arrangement& arrangement,
                                             const SynthesisParams& params, const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckDiamondSizes(exemplar.width(), exemplar.height(), params));
  const std::vector<CornerPair> pairs = CornerPairs(arrangement);
  const int num_tiles = static_cast<int>(arrangement.codes.size());
  const size_t tile_area = static_cast<size_t>(params.tile_size) * params.tile_size;
  IndexMaps maps{.tile_size = params.tile_size,
                 .texels = std::vector<uint32_t>(tile_area * num_tiles, kNoTexel),
                 .strips = {},
                 .tile_reports = std::vector<FillReport>(num_tiles),
                 .diamonds = {}};
  TESSERA_ASSIGN_OR_RETURN(const Samples samples,
                           ChooseSamples(exemplar, arrangement, pairs, params, context, maps.diamonds));
  for (const Patch& sample : samples) {
    maps.strips.push_back(StripOfSample(exemplar, sample, params.tile_size));
  }

  Corners corners{
      .strip_height = params.tile_size, .samples = {}, .cuts = std::vector<CornerCut>(pairs.size())};
  ParallelFor(context, 0, static_cast<int64_t>(pairs.size()), 1, [&](int64_t i, int64_t) {
    const Overlap overlap = OverlapOf(exemplar, samples, pairs[i], params);
    OverlapCut cut = params.method == SynthesisMethod::kDiamondDp ? CutByPath(exemplar, overlap)
                                                                  : CutByMinimum(exemplar, overlap);
    corners.cuts[i] = {.pair = pairs[i], .in_wins = std::move(cut.in_wins), .cost = cut.cost};
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  for (const CornerCut& cut : corners.cuts) {
    maps.corner_cost += cut.cost;
  }
  maps.corner_seams = static_cast<int64_t>(corners.cuts.size());

  context.Report("tiles", 0, num_tiles, "tiles");
  ParallelFor(context, 0, num_tiles, 1, [&](int64_t tile, int64_t) {
    const std::vector<uint32_t> texels =
        BuildFrame(arrangement, arrangement.SidesOf(tile), corners, maps.strips);
    std::ranges::copy(texels, maps.texels.begin() + static_cast<std::ptrdiff_t>(tile * tile_area));
    maps.tile_reports[tile] = MeasureTile(exemplar, texels, params);
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  context.Report("tiles", num_tiles, num_tiles, "tiles");
  return maps;
}

}  // namespace tessera
