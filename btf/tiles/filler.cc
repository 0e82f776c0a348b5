#include "btf/tiles/filler.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <utility>

#include "btf/base/rng.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace {

// A patch leaves the search at least a quarter of a region's shorter side to move in.
constexpr double kLargestWindowShare = 0.75;
// First windows, in halves of a feature: small enough that one patch can meet all that is known around it.
constexpr int kFirstFeatures = 5;
// Share of a first window that should be known already; below it a place is less wanted.
constexpr double kWantedOverlap = 0.15;
constexpr int kKeptPerCut = 3;  // candidates that a search keeps for each that is cut

// How a window is matched. First windows bring most of the content, so they range far and pay for repetition;
// improvements look for the best fit.
struct Matching {
  int trials = 0;            // candidates that are cut, of eight asked for
  double repetition = 0.0;   // price of a patch used as often as the mean
  double temperature = 0.0;  // of the draw among candidates
  int separation = 0;        // of candidates, in eighths of a feature
  bool must_improve = false;
};
constexpr Matching kFirst = {
    .trials = 8, .repetition = 1.0, .temperature = 0.3, .separation = 4, .must_improve = false};
constexpr Matching kImprove = {
    .trials = 3, .repetition = 0.1, .temperature = 0.1, .separation = 1, .must_improve = true};

constexpr double kFixedWeight = 2.0;  // of texels that will stay, against free ones
constexpr double kSeamDoubt = 2.0;    // how fast a texel's weight falls with its mismatch in mean steps
// Improvements tried for each h x h of free texels; at least and, while thresholds are missed, at most.
constexpr int kPatchesPerFeature = 5;
constexpr int kFewestPatches = 24;
constexpr int kPatience = 4;           // times as many while a threshold is missed
constexpr int kFruitlessPatches = 24;  // improvements in a row that fail before a good canvas is left alone

enum FillSeed : uint64_t { kLaySeed = 1, kImproveSeed = 2 };

int LargestWindow(const ExemplarSpectra& spectra, int feature_size) {
  const int shorter = spectra.shorter_side();
  return std::min(shorter, std::max(feature_size, static_cast<int>(kLargestWindowShare * shorter)));
}

// The place that covers most unfilled texels with enough known ones around.
Window FirstWindow(const Canvas& canvas, int largest, int feature_size) {
  Window window{0, 0, std::min(largest, canvas.width()), std::min(largest, canvas.height())};
  const int lattice = std::max(1, feature_size / 4);
  std::vector<int> sums(static_cast<size_t>(canvas.width() + 1) * (canvas.height() + 1), 0);
  const auto sum = [&](int x, int y) -> int& {
    return sums[static_cast<size_t>(y) * (canvas.width() + 1) + x];
  };
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x) {
      sum(x + 1, y + 1) = sum(x, y + 1) + sum(x + 1, y) - sum(x, y) + (canvas.filled(x, y) ? 0 : 1);
    }
  }
  const double area = static_cast<double>(window.width) * window.height;
  double best = -1.0;
  Window chosen = window;
  for (int y = 0;; y = std::min(y + lattice, canvas.height() - window.height)) {
    for (int x = 0;; x = std::min(x + lattice, canvas.width() - window.width)) {
      const int unfilled = sum(x + window.width, y + window.height) - sum(x, y + window.height) -
                           sum(x + window.width, y) + sum(x, y);
      const double overlap = (area - unfilled) / area;
      const double score = unfilled * (0.01 + std::min(1.0, overlap / kWantedOverlap));
      if (score > best) {
        best = score;
        chosen.x = x;
        chosen.y = y;
      }
      if (x == canvas.width() - window.width) {
        break;
      }
    }
    if (y == canvas.height() - window.height) {
      break;
    }
  }
  return chosen;
}

// A free texel drawn in proportion to the square of its dearest seam; none when there are no seams.
std::optional<std::array<int, 2>> DrawBadTexel(const Canvas& canvas, Rng& rng) {
  std::vector<double> sums(static_cast<size_t>(canvas.width()) * canvas.height());
  double total = 0.0;
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x) {
      const double cost = canvas.fixed(x, y) ? 0.0 : canvas.TexelCost(x, y);
      total += cost * cost;
      sums[static_cast<size_t>(y) * canvas.width() + x] = total;
    }
  }
  const double draw = rng.NextDouble() * total;
  if (total == 0.0) {
    return std::nullopt;
  }
  const auto index = std::upper_bound(sums.begin(), sums.end(), draw) - sums.begin();
  const int clamped =
      static_cast<int>(std::min<std::ptrdiff_t>(index, static_cast<std::ptrdiff_t>(sums.size()) - 1));
  return std::array<int, 2>{clamped % canvas.width(), clamped / canvas.width()};
}

void MakeQuery(const Canvas& canvas, const Window& window, SearchQuery& query) {
  const Exemplar& exemplar = canvas.exemplar();
  const int dims = exemplar.search_dims();
  query.width = window.width;
  query.height = window.height;
  query.weights.assign(static_cast<size_t>(window.width) * window.height, 0.0f);
  query.wanted.assign(query.weights.size() * dims, 0.0f);
  for (int y = 0; y < window.height; ++y) {
    for (int x = 0; x < window.width; ++x) {
      const uint32_t texel = canvas.texel(window.x + x, window.y + y);
      if (texel == kNoTexel || canvas.placed(window.x + x, window.y + y)) {
        continue;
      }
      const size_t index = static_cast<size_t>(y) * window.width + x;
      const double mismatch = MismatchOfCost(canvas.TexelCost(window.x + x, window.y + y));
      query.weights[index] = static_cast<float>(
          canvas.fixed(window.x + x, window.y + y) ? kFixedWeight : 1.0 / (1.0 + kSeamDoubt * mismatch));
      std::copy_n(exemplar.Point(texel), dims,
                  query.wanted.begin() + static_cast<std::ptrdiff_t>(index * dims));
    }
  }
}

// Searches patches for the window, cuts some of the best and keeps the cheapest, one that repeats a sibling
// only when the window must be filled and all of them do. Returns how many texels it changed.
int MatchWindow(const ExemplarSpectra& spectra, const FillParams& params, const Window& window,
                const Matching& matching, const std::stop_token& stop, Rng& rng, FillerScratch& scratch,
                Canvas& canvas, FillReport& report) {
  MakeQuery(canvas, window, scratch.query);
  const int separation = std::max(1, matching.separation * params.feature_size / 8);
  const int first_region = spectra.DrawRegion(rng);
  std::vector<Candidate> candidates;
  // Where texels are excluded, a region may have nothing to give.
  for (int i = 0; i < spectra.num_regions() && candidates.empty() && !stop.stop_requested(); ++i) {
    candidates = scratch.search.Search(scratch.query, (first_region + i) % spectra.num_regions(),
                                       params.turns, params.usage, matching.repetition,
                                       kKeptPerCut * params.num_candidates, separation, stop);
  }
  const int trials = (matching.trials * params.num_candidates + 7) / 8;
  candidates = SampleCandidates(std::move(candidates), trials, matching.temperature, rng);
  std::optional<Patch> best_patch;
  PatchCut best_cut;
  bool best_repeats = false;
  for (const Candidate& candidate : candidates) {
    const PatchCut& cut = scratch.cutter.Cut(canvas, window, candidate.patch);
    ++report.num_patches;
    if (cut.num_new == 0 || (matching.must_improve && cut.cost_change >= 0)) {
      continue;
    }
    const bool repeats = params.siblings != nullptr &&
                         params.siblings->Repeats(canvas.exemplar(), window, candidate.patch, cut);
    if (repeats && matching.must_improve) {
      continue;
    }
    if (!best_patch || std::pair(repeats, cut.cost_change) < std::pair(best_repeats, best_cut.cost_change)) {
      best_patch = candidate.patch;
      best_cut = cut;
      best_repeats = repeats;
    }
  }
  if (!best_patch) {
    return 0;
  }
  PatchCutter::Apply(window, *best_patch, best_cut, canvas);
  ++report.num_kept;
  report.num_truncated += best_cut.num_truncated;
  return best_cut.num_new;
}

}  // namespace

int FirstWindowSide(const ExemplarSpectra& spectra, int feature_size) {
  return std::min(LargestWindow(spectra, feature_size), kFirstFeatures * feature_size / 2);
}

FillReport MeasureCanvas(const Canvas& canvas, const FillParams& params) {
  FillReport report;
  const Canvas::Totals totals = canvas.Measure();
  const Exemplar& exemplar = canvas.exemplar();
  if (totals.num_seams > 0) {
    report.mean_mismatch =
        MismatchOfCost(static_cast<double>(totals.cost)) / static_cast<double>(totals.num_seams);
  }
  report.largest_mismatch = MismatchOfCost(totals.largest_cost) * exemplar.mean_step() / exemplar.spread();
  report.reached = canvas.num_unfilled() == 0 && report.mean_mismatch <= params.mean_threshold &&
                   report.largest_mismatch <= params.texel_threshold;
  return report;
}

void Filler::Lay(const Window& window, const Patch& patch, Canvas& canvas, FillReport& report) {
  const PatchCut& cut = scratch_.cutter.Cut(canvas, window, patch);
  ++report.num_patches;
  ++report.num_kept;
  report.num_truncated += cut.num_truncated;
  PatchCutter::Apply(window, patch, cut, canvas);
}

void Filler::LayAround(const PlacedFeature& feature, int margin, Canvas& canvas, FillReport& report) {
  const Exemplar& exemplar = canvas.exemplar();
  const PlacedTexel& first = feature.front();
  const int turn = TurnsOfTexel(first.texel);
  // Columns and rows of the turned exemplar, less those of the canvas.
  const auto [u, v] = exemplar.TurnedPosition(first.texel);
  const int from_x = u - first.x;
  const int from_y = v - first.y;
  int left = first.x;
  int top = first.y;
  int right = first.x;
  int bottom = first.y;
  for (const PlacedTexel& at : feature) {
    left = std::min(left, at.x);
    top = std::min(top, at.y);
    right = std::max(right, at.x);
    bottom = std::max(bottom, at.y);
  }
  for (int depth = margin; depth >= 0; --depth) {
    Window window{std::max({left - depth, 0, -from_x}), std::max({top - depth, 0, -from_y}), 0, 0};
    window.width =
        std::min({right + depth + 1, canvas.width(), exemplar.TurnedWidth(turn) - from_x}) - window.x;
    window.height =
        std::min({bottom + depth + 1, canvas.height(), exemplar.TurnedHeight(turn) - from_y}) - window.y;
    const Patch patch{turn, window.x + from_x, window.y + from_y};
    bool is_allowed = true;
    for (int y = 0; y < window.height && is_allowed; ++y) {
      for (int x = 0; x < window.width && is_allowed; ++x) {
        is_allowed = canvas.placed(window.x + x, window.y + y) ||
                     !spectra_->excludes(exemplar.TexelAt(turn, patch.u + x, patch.v + y));
      }
    }
    if (is_allowed) {
      Lay(window, patch, canvas, report);
      return;
    }
  }
}

absl::Status Filler::LayEmpty(const FillParams& params, const RunContext& context, Canvas& canvas,
                              FillReport& report) {
  Rng rng(Mix64(params.seed, kLaySeed));
  const int first = FirstWindowSide(*spectra_, params.feature_size);
  while (canvas.num_unfilled() > 0) {
    const Window window = FirstWindow(canvas, first, params.feature_size);
    const int changed =
        MatchWindow(*spectra_, params, window, kFirst, context.stop, rng, scratch_, canvas, report);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (changed == 0) {
      return absl::InternalError("no patch covers the empty part of a canvas");
    }
  }
  return absl::OkStatus();
}

absl::Status Filler::Improve(const FillParams& params, const RunContext& context, Canvas& canvas,
                             FillReport& report) {
  Rng rng(Mix64(params.seed, kImproveSeed));
  const int largest = LargestWindow(*spectra_, params.feature_size);
  int num_free = 0;
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x) {
      num_free += canvas.fixed(x, y) ? 0 : 1;
    }
  }
  const int feature_area = params.feature_size * params.feature_size;
  const int budget = std::max(kFewestPatches, kPatchesPerFeature * num_free / feature_area);
  int fruitless = 0;
  for (int round = 0; round < budget * kPatience; ++round) {
    if ((round >= budget || fruitless >= kFruitlessPatches) && MeasureCanvas(canvas, params).reached) {
      break;
    }
    const auto focus = DrawBadTexel(canvas, rng);
    if (!focus) {
      break;
    }
    // 1, 1.5, 2 or 3 features wide and high, centred on the bad texel as far as the canvas allows.
    constexpr std::array<int, 4> kHalfFeatures = {2, 3, 4, 6};
    const int wanted = kHalfFeatures[rng.NextBelow(kHalfFeatures.size())] * params.feature_size / 2;
    Window window{0, 0, std::min({wanted, largest, canvas.width()}),
                  std::min({wanted, largest, canvas.height()})};
    window.x = std::clamp((*focus)[0] - window.width / 2, 0, canvas.width() - window.width);
    window.y = std::clamp((*focus)[1] - window.height / 2, 0, canvas.height() - window.height);
    const int changed =
        MatchWindow(*spectra_, params, window, kImprove, context.stop, rng, scratch_, canvas, report);
    fruitless = changed > 0 ? 0 : fruitless + 1;
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  const FillReport measured = MeasureCanvas(canvas, params);
  report.mean_mismatch = measured.mean_mismatch;
  report.largest_mismatch = measured.largest_mismatch;
  report.reached = measured.reached;
  return absl::OkStatus();
}

absl::Status Filler::Fill(const FillParams& params, const RunContext& context, Canvas& canvas,
                          FillReport& report) {
  TESSERA_RETURN_IF_ERROR(LayEmpty(params, context, canvas, report));
  return Improve(params, context, canvas, report);
}

}  // namespace tessera
