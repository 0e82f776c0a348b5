#include "btf/tiles/filler.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
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
// improvements look for the best fit, and for several.
struct Matching {
  double repetition = 0.0;   // price of a patch used as often as the mean
  double temperature = 0.0;  // of the draw among candidates
  int separation = 0;        // of candidates, in eighths of a feature
  int halves = 2;            // of the candidates asked for
};
constexpr Matching kFirst = {.repetition = 1.0, .temperature = 0.3, .separation = 4, .halves = 1};
constexpr Matching kImprove = {.repetition = 0.1, .temperature = 1.0, .separation = 1};

constexpr double kFixedWeight = 2.0;   // of texels that will stay, against free ones
constexpr double kFailureDoubt = 0.3;  // how fast a texel is drawn less with windows that changed nothing
constexpr double kSeamDoubt = 2.0;     // how fast a texel's weight falls with its mismatch in mean steps
constexpr int kMostHalfFeatures = 4;   // sides of windows that improve: one to four halves of a feature
// Windows tried for each h x h of free texels; at least; and, while thresholds are missed, at most.
constexpr int kWindowsPerFeature = 4;
constexpr int kFewestWindows = 24;
constexpr int kPatience = 4;  // times as many while a threshold is missed
// By how much FillReport::step_ratio of a canvas that is good may exceed 1, divided by the effort. Grazing
// views, from which seams show most, count more in the embedding for seams than in a certificate.
constexpr double kGoodExcess = 0.08;
// The share of windows tried even on a good canvas: its few bad seams are seen all the same.
constexpr double kGoodShare = 0.2;
constexpr int kWindowsPerMeasure = 16;  // a canvas is measured once for so many

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

// Draws free texels in proportion to the square of their dearest seam, the less often the more often windows
// centred near them changed nothing.
class BadTexels {
 public:
  explicit BadTexels(const Canvas& canvas)
      : canvas_(&canvas),
        failures_(static_cast<size_t>(canvas.width()) * canvas.height(), 0),
        row_weights_(canvas.height(), 0.0) {
    WeighRows(0, canvas.height());
  }

  // None when there are no seams.
  [[nodiscard]] std::optional<std::array<int, 2>> Draw(Rng& rng) const {
    const double total = std::accumulate(row_weights_.begin(), row_weights_.end(), 0.0);
    if (total == 0.0) {
      return std::nullopt;
    }
    double draw = rng.NextDouble() * total;
    int y = 0;
    while (y + 1 < canvas_->height() && draw >= row_weights_[y]) {
      draw -= row_weights_[y++];
    }
    int x = 0;
    while (x + 1 < canvas_->width() && draw >= WeightOf(x, y)) {
      draw -= WeightOf(x++, y);
    }
    return std::array<int, 2>{x, y};
  }

  // Call when a window centred on `texel` changed nothing.
  void Fail(const std::array<int, 2>& texel, int feature_size) {
    const int reach = feature_size / 4;
    for (int y = std::max(0, texel[1] - reach); y <= std::min(canvas_->height() - 1, texel[1] + reach); ++y) {
      for (int x = std::max(0, texel[0] - reach); x <= std::min(canvas_->width() - 1, texel[0] + reach);
           ++x) {
        ++failures_[Index(x, y)];
      }
    }
    WeighRows(texel[1] - reach, texel[1] + reach + 1);
  }

  // Call when the canvas has changed in the window.
  void Change(const Window& window) {
    for (int y = window.y; y < window.y + window.height; ++y) {
      std::fill_n(failures_.begin() + static_cast<std::ptrdiff_t>(Index(window.x, y)), window.width, 0);
    }
    WeighRows(window.y - 1, window.y + window.height + 1);
  }

 private:
  [[nodiscard]] size_t Index(int x, int y) const { return static_cast<size_t>(y) * canvas_->width() + x; }

  [[nodiscard]] double WeightOf(int x, int y) const {
    const double cost = canvas_->fixed(x, y) ? 0.0 : canvas_->TexelCost(x, y);
    const double weight = cost / (1.0 + kFailureDoubt * failures_[Index(x, y)]);
    return weight * weight;
  }

  void WeighRows(int first, int end) {
    for (int y = std::max(0, first); y < std::min(canvas_->height(), end); ++y) {
      row_weights_[y] = 0.0;
      for (int x = 0; x < canvas_->width(); ++x) {
        row_weights_[y] += WeightOf(x, y);
      }
    }
  }

  const Canvas* canvas_;
  std::vector<int> failures_;  // by texel
  std::vector<double> row_weights_;
};

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

// Patches for the window, drawn among those that fit it best.
std::vector<Candidate> DrawPatches(const ExemplarSpectra& spectra, const FillParams& params,
                                   const Window& window, const Matching& matching, const Canvas& canvas,
                                   const RunContext& context, Rng& rng, FillerScratch& scratch) {
  MakeQuery(canvas, window, scratch.query);
  const int separation = std::max(1, matching.separation * params.feature_size / 8);
  const int first_region = spectra.DrawRegion(rng);
  std::vector<Candidate> candidates;
  // Where texels are excluded, a region may have nothing to give.
  for (int i = 0; i < spectra.num_regions() && candidates.empty() && !context.stop.stop_requested(); ++i) {
    candidates = scratch.search.Search(scratch.query, (first_region + i) % spectra.num_regions(),
                                       params.turns, params.usage, matching.repetition,
                                       kKeptPerCut * params.num_candidates, separation, context.stop);
  }
  const int count = (params.num_candidates * matching.halves + 1) / 2;
  return SampleCandidates(std::move(candidates), count, matching.temperature, rng);
}

bool Repeats(const FillParams& params, const Canvas& canvas, const Window& window, const Patch& patch,
             const PatchCut& cut) {
  return params.siblings != nullptr && params.siblings->Repeats(canvas.exemplar(), window, patch, cut);
}

void Keep(const Window& window, const Patch& patch, const PatchCut& cut, Canvas& canvas, FillReport& report) {
  PatchCutter::Apply(window, patch, cut, canvas);
  ++report.num_kept;
  report.num_truncated += cut.num_truncated;
}

// Lays the cheapest patch that repeats no sibling, or the cheapest of all where every one does. Returns
// whether any texel changed.
bool FillWindow(const FillParams& params, const Window& window, const std::vector<Candidate>& candidates,
                FillerScratch& scratch, Canvas& canvas, FillReport& report) {
  const Patch* best_patch = nullptr;
  PatchCut best_cut;
  bool best_repeats = true;
  for (const Candidate& candidate : candidates) {
    const int64_t limit = best_repeats ? kAnyChange : best_cut.cost_change;
    const PatchCut& cut = scratch.cutter.Cut(canvas, window, candidate.patch, limit);
    ++report.num_patches;
    if (cut.num_new == 0) {
      continue;
    }
    const bool repeats = Repeats(params, canvas, window, candidate.patch, cut);
    if (best_patch == nullptr ||
        std::pair(repeats, cut.cost_change) < std::pair(best_repeats, best_cut.cost_change)) {
      best_patch = &candidate.patch;
      best_cut = cut;
      best_repeats = repeats;
    }
  }
  if (best_patch == nullptr) {
    return false;
  }
  Keep(window, *best_patch, best_cut, canvas, report);
  return true;
}

// Lays every patch that makes the canvas cheaper and repeats no sibling: one search serves several. Returns
// whether there was any.
bool ImproveWindow(const FillParams& params, const Window& window, const std::vector<Candidate>& candidates,
                   FillerScratch& scratch, Canvas& canvas, FillReport& report) {
  bool improved = false;
  for (const Candidate& candidate : candidates) {
    const PatchCut& cut = scratch.cutter.Cut(canvas, window, candidate.patch, 0);
    ++report.num_patches;
    if (cut.num_new > 0 && !Repeats(params, canvas, window, candidate.patch, cut)) {
      Keep(window, candidate.patch, cut, canvas, report);
      improved = true;
    }
  }
  return improved;
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
  report.step_ratio = totals.own_step > 0.0 ? totals.step / totals.own_step : 0.0;
  report.largest_mismatch = MismatchOfCost(totals.largest_cost) * exemplar.mean_step() / exemplar.spread();
  report.reached = canvas.num_unfilled() == 0 && report.mean_mismatch <= params.mean_threshold &&
                   report.largest_mismatch <= params.texel_threshold;
  return report;
}

void Filler::Lay(const Window& window, const Patch& patch, Canvas& canvas, FillReport& report) {
  ++report.num_patches;
  Keep(window, patch, scratch_.cutter.Cut(canvas, window, patch), canvas, report);
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
    const std::vector<Candidate> patches =
        DrawPatches(*spectra_, params, window, kFirst, canvas, context, rng, scratch_);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (!FillWindow(params, window, patches, scratch_, canvas, report)) {
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
  const int64_t num_features = num_free / (params.feature_size * params.feature_size);
  const int64_t budget = params.effort * std::max<int64_t>(kFewestWindows, kWindowsPerFeature * num_features);
  const double good_ratio = 1.0 + kGoodExcess / params.effort;
  BadTexels bad_texels(canvas);
  for (int64_t round = 0; round < budget * kPatience; ++round) {
    if (round % kWindowsPerMeasure == 0) {
      const FillReport measured = MeasureCanvas(canvas, params);
      if (measured.reached &&
          (round >= budget || (round >= kGoodShare * budget && measured.step_ratio <= good_ratio))) {
        break;
      }
    }
    const auto focus = bad_texels.Draw(rng);
    if (!focus) {
      break;
    }
    // Centred on the bad texel as far as the canvas allows.
    const int wanted = (1 + static_cast<int>(rng.NextBelow(kMostHalfFeatures))) * params.feature_size / 2;
    Window window{0, 0, std::min({wanted, largest, canvas.width()}),
                  std::min({wanted, largest, canvas.height()})};
    window.x = std::clamp((*focus)[0] - window.width / 2, 0, canvas.width() - window.width);
    window.y = std::clamp((*focus)[1] - window.height / 2, 0, canvas.height() - window.height);
    const std::vector<Candidate> patches =
        DrawPatches(*spectra_, params, window, kImprove, canvas, context, rng, scratch_);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (ImproveWindow(params, window, patches, scratch_, canvas, report)) {
      bad_texels.Change(window);
    } else {
      bad_texels.Fail(*focus, params.feature_size);
    }
  }
  const FillReport measured = MeasureCanvas(canvas, params);
  report.step_ratio = measured.step_ratio;
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
