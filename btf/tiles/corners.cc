#include "btf/tiles/corners.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/tiles/border_cut.h"

namespace tessera {
namespace {

constexpr int kStarts = 16;            // random starts
constexpr int kSweeps = 4;             // over all samples; the last is greedy
constexpr int kCornerCandidates = 80;  // cut for each sample and sweep
// What a set of samples costs: the mean mismatch of its cuts in mean steps, plus these prices, each on
// average over the samples. Two samples from one place, falling to 0 where they are a strip height apart.
// Dear enough that no cut is worth it: a set cut from one patch has no seams at all, and every tile looks
// alike.
constexpr double kNearnessPrice = 6.0;
// A sample that stands out: the squared distance of its mean from the exemplar's, against that of a sample
// drawn at random, and the absolute logarithm of its variance against the same. Every vertex of a dressed
// mesh shows corner samples, so one that is bland or striking would draw the grid.
constexpr double kMeanPrice = 0.2;
constexpr double kVariancePrice = 0.3;
// Of the vertex texel against the one across the border, beside the pairs of the cut: most borders have no
// other seams than at their ends, so all that shows of a border is there.
constexpr int kVertexWeight = 16;
constexpr double kTemperature = 0.02;  // of the draw, in mean steps
constexpr int kTypicalDraws = 256;     // random samples that tell what is typical

// Where in a sample a corner texel lies.
struct SampleTexel {
  int sample = 0;
  int x = 0;
  int y = 0;
  int turns = 0;
};

SampleTexel OutTexel(const CornerPair& pair, int i, int j, int strip_height) {
  const StripTexel texel = StripTexelAt(0, pair.out.sign, i, j, strip_height, strip_height);
  const int half = strip_height / 2;
  return {2 * pair.out.strip + texel.x / half, texel.x % half, texel.y, texel.turns};
}

SampleTexel InTexel(const CornerPair& pair, int i, int j, int strip_height) {
  const StripTexel texel = StripTexelAt(3, pair.in.sign, strip_height - 1 - j, i, strip_height, strip_height);
  const int half = strip_height / 2;
  return {2 * pair.in.strip + texel.x / half, texel.x % half, texel.y, texel.turns};
}

uint32_t TexelOf(const Exemplar& exemplar, const std::vector<Patch>& samples, const SampleTexel& at) {
  const Patch& patch = samples[at.sample];
  return TurnTexel(exemplar.TexelAt(patch.turn, patch.u + at.x, patch.v + at.y), at.turns);
}

// Cuts one pair. The square is laid out as a picture: column i, row h/2 - 1 - j.
CornerCut CutPair(const Exemplar& exemplar, const std::vector<Patch>& samples, const CornerPair& pair,
                  int strip_height, BorderCut& grid, std::vector<uint32_t>& scratch) {
  const int half = strip_height / 2;
  const int area = half * half;
  scratch.resize(static_cast<size_t>(2) * area);
  uint32_t* const out = scratch.data();
  uint32_t* const in = out + area;
  for (int j = 0; j < half; ++j) {
    for (int i = 0; i < half; ++i) {
      const int index = (half - 1 - j) * half + i;
      out[index] = TexelOf(exemplar, samples, OutTexel(pair, i, j, strip_height));
      in[index] = TexelOf(exemplar, samples, InTexel(pair, i, j, strip_height));
    }
  }
  // Source side shows `out`, sink side `in`. Beyond the square, a column on the right goes on with `out` and
  // a row on top with `in`: the way round from vertex to opposite corner is out's on the right and below,
  // in's on the left and above.
  grid.Reset(half + 1, half + 1);
  grid.SetTerminals({{half, 1}, {0, half}}, {{0, half - 1}, {half - 1, 0}});
  for (int y = 0; y < half; ++y) {
    for (int x = 0; x < half; ++x) {
      const int p = y * half + x;
      const auto set_edge = [&](GridCut::Direction direction, int q) {
        grid.SetEdge(x, y + 1, direction, PairCost(exemplar, out[p], in[q], direction),
                     PairCost(exemplar, in[p], out[q], direction));
      };
      if (x + 1 < half) {
        set_edge(GridCut::kRight, p + 1);
      } else if (const uint32_t beyond = exemplar.Step(out[p], GridCut::kRight); beyond != kNoTexel) {
        grid.SetEdge(x, y + 1, GridCut::kRight, 0, PairCost(exemplar, in[p], beyond, GridCut::kRight));
      }
      if (y + 1 < half) {
        set_edge(GridCut::kDown, p + half);
      }
      if (y == 0) {
        if (const uint32_t beyond = exemplar.Step(in[p], GridCut::kUp); beyond != kNoTexel) {
          grid.SetEdge(x, y + 1, GridCut::kUp, PairCost(exemplar, out[p], beyond, GridCut::kUp), 0);
        }
      }
    }
  }
  CornerCut cut{.pair = pair, .in_wins = std::vector<uint8_t>(area), .cost = grid.Solve()};
  // Across side `in`, the neighbouring tile shows the other half of that strip up to the vertex, here `out`
  // does.
  const uint32_t across = TexelOf(exemplar, samples, InTexel(pair, -1, 0, strip_height));
  cut.vertex_cost = PairCost(exemplar, out[(half - 1) * half], across, GridCut::kLeft);
  for (int j = 0; j < half; ++j) {
    for (int i = 0; i < half; ++i) {
      cut.in_wins[static_cast<size_t>(j) * half + i] = grid.OnSourceSide(i, half - j) ? 0 : 1;
    }
  }
  return cut;
}

// Twice the middle of a sample in the unturned exemplar, so that it is whole.
std::array<int, 2> TwiceMiddle(const Exemplar& exemplar, const Patch& patch, int strip_height) {
  const auto first = static_cast<int>(BtfelOfTexel(exemplar.TexelAt(patch.turn, patch.u, patch.v)));
  const auto last = static_cast<int>(
      BtfelOfTexel(exemplar.TexelAt(patch.turn, patch.u + strip_height / 2 - 1, patch.v + strip_height - 1)));
  const int width = exemplar.width();
  return {first % width + last % width, first / width + last / width};
}

// How near two samples lie in the exemplar, whatever their turns: 1 in one place, 0 a strip height apart.
double Nearness(const Exemplar& exemplar, const Patch& a, const Patch& b, int strip_height) {
  const auto p = TwiceMiddle(exemplar, a, strip_height);
  const auto q = TwiceMiddle(exemplar, b, strip_height);
  const int distance = std::max(std::abs(p[0] - q[0]), std::abs(p[1] - q[1]));
  return std::max(0.0, 1.0 - distance / (2.0 * strip_height));
}

// Texels around a sample that must lie in the exemplar: strips go on beyond their samples, and what lies
// there is compared along the cuts, so a place at the rim would look cheaper than it is. Small exemplars have
// less.
int Margin(int exemplar_side, int sample_side, int strip_height) {
  return std::min(strip_height / 2, (exemplar_side - sample_side) / 4);
}

// One start: state and improvement of all samples.
class CornerSearch {
 public:
  CornerSearch(const ExemplarSpectra& spectra, const Arrangement& arrangement, int strip_height,
               uint64_t seed, const std::vector<std::optional<Patch>>& by_hand)
      : spectra_(spectra),
        exemplar_(spectra.exemplar()),
        strip_height_(strip_height),
        pairs_(CornerPairs(arrangement)),
        search_(spectra),
        rng_(seed) {
    for (int strip = 0; strip < NumStrips(arrangement); ++strip) {
      for (int end = 0; end < 2; ++end) {
        turns_.push_back(TurnsOfStrip(arrangement, strip));
        samples_.push_back(RandomPlace(turns_.back()));
      }
    }
    is_by_hand_.resize(samples_.size(), false);
    for (size_t sample = 0; sample < by_hand.size(); ++sample) {
      is_by_hand_[sample] = by_hand[sample].has_value();
      samples_[sample] = by_hand[sample].value_or(samples_[sample]);
    }
    for (int draw = 0; draw < kTypicalDraws; ++draw) {
      const Statistics statistics = Measure(RandomPlace(turns_[draw % turns_.size()]));
      typical_.mean_distance += statistics.mean_distance / kTypicalDraws;
      typical_.variance += statistics.variance / kTypicalDraws;
    }
  }

  void Improve(int sample, bool greedy, const std::stop_token& stop) {
    if (is_by_hand_[sample]) {
      return;
    }
    MakeQuery(sample);
    const std::vector<Candidate> candidates = search_.Search(
        query_, spectra_.DrawRegion(rng_), turns_[sample], nullptr, 0.0, kCornerCandidates, 1, stop);
    const Patch before = samples_[sample];
    std::vector<Patch> patches = {before};
    std::vector<double> costs = {CostAround(sample)};
    for (const Candidate& candidate : candidates) {
      if (!KeepsMargin(candidate.patch)) {
        continue;
      }
      samples_[sample] = candidate.patch;
      patches.push_back(candidate.patch);
      costs.push_back(CostAround(sample));
    }
    const auto best = static_cast<size_t>(std::min_element(costs.begin(), costs.end()) - costs.begin());
    samples_[sample] = patches[greedy ? best : Draw(costs, costs[best])];
  }

  // The mean mismatch of the cuts, with the prices of overlap and of standing out.
  [[nodiscard]] double TotalCost() {
    double cost = 0.0;
    for (const CornerPair& pair : pairs_) {
      cost += PairMismatch(pair);
    }
    double prices = 0.0;
    for (int sample = 0; sample < num_samples(); ++sample) {
      prices += Price(sample);
    }
    return cost / static_cast<double>(pairs_.size()) + prices / num_samples();
  }

  [[nodiscard]] int num_samples() const { return static_cast<int>(samples_.size()); }

  [[nodiscard]] Corners Result() {
    Corners corners{.strip_height = strip_height_, .samples = samples_, .cuts = {}, .cost = TotalCost()};
    for (const CornerPair& pair : pairs_) {
      corners.cuts.push_back(CutPair(exemplar_, samples_, pair, strip_height_, grid_, scratch_));
    }
    return corners;
  }

 private:
  // What the sample should look like: the mean of everything it meets, seen in its own frame.
  void MakeQuery(int sample) {
    const int half = strip_height_ / 2;
    const int dims = exemplar_.search_dims();
    query_.width = half;
    query_.height = strip_height_;
    query_.weights.assign(static_cast<size_t>(half) * strip_height_, 0.0f);
    query_.wanted.assign(query_.weights.size() * dims, 0.0f);
    const auto add = [&](const SampleTexel& own, const SampleTexel& other) {
      if (own.sample != sample || other.sample == sample) {
        return;
      }
      SampleTexel seen = other;
      seen.turns = other.turns - own.turns + 4;
      const float* const point = exemplar_.Point(TexelOf(exemplar_, samples_, seen));
      const size_t index = static_cast<size_t>(own.y) * half + own.x;
      query_.weights[index] += 1.0f;
      for (int dim = 0; dim < dims; ++dim) {
        query_.wanted[index * dims + dim] += point[dim];
      }
    };
    for (const CornerPair& pair : pairs_) {
      for (int j = 0; j < half; ++j) {
        for (int i = 0; i < half; ++i) {
          const SampleTexel out = OutTexel(pair, i, j, strip_height_);
          const SampleTexel in = InTexel(pair, i, j, strip_height_);
          add(out, in);
          add(in, out);
        }
      }
    }
    for (size_t i = 0; i < query_.weights.size(); ++i) {
      for (int dim = 0; dim < dims && query_.weights[i] > 0.0f; ++dim) {
        query_.wanted[i * dims + dim] /= query_.weights[i];
      }
    }
  }

  // Of a cut, per texel of its shortest course, in mean steps.
  [[nodiscard]] double PairMismatch(const CornerPair& pair) {
    const CornerCut cut = CutPair(exemplar_, samples_, pair, strip_height_, grid_, scratch_);
    const auto cost = static_cast<double>(cut.cost + kVertexWeight * cut.vertex_cost);
    return MismatchOfCost(cost) / (strip_height_ / 2);
  }

  [[nodiscard]] double Price(int sample) const {
    double nearness = 0.0;
    for (int other = 0; other < num_samples(); ++other) {
      if (other != sample) {
        nearness += Nearness(exemplar_, samples_[sample], samples_[other], strip_height_);
      }
    }
    const Statistics statistics = Measure(samples_[sample]);
    constexpr double kTiny = 1e-12;  // of a constant exemplar
    return kNearnessPrice * nearness +
           kMeanPrice * statistics.mean_distance / (typical_.mean_distance + kTiny) +
           kVariancePrice * std::abs(std::log((statistics.variance + kTiny) / (typical_.variance + kTiny)));
  }

  // The part of TotalCost that depends on one sample, up to a constant factor of its cuts.
  [[nodiscard]] double CostAround(int sample) {
    double cost = 0.0;
    for (const CornerPair& pair : pairs_) {
      const int in = 2 * pair.in.strip + static_cast<int>(EndAtCorner(pair.in, false));
      const int out = 2 * pair.out.strip + static_cast<int>(EndAtCorner(pair.out, true));
      if (in == sample || out == sample) {
        cost += PairMismatch(pair);
      }
    }
    return cost / static_cast<double>(pairs_.size()) + Price(sample) / num_samples();
  }

  struct Statistics {
    double mean_distance = 0.0;  // squared, of the sample's mean from the exemplar's
    double variance = 0.0;       // about the sample's own mean
  };

  // Of the middle rows, those nearest the vertex, in the search dimensions.
  [[nodiscard]] Statistics Measure(const Patch& patch) const {
    const int dims = exemplar_.search_dims();
    const int margin = strip_height_ / 4;
    const double count = (strip_height_ - 2 * margin) * (strip_height_ / 2);
    std::array<double, kSearchDims> sum{};
    double square = 0.0;
    for (int y = margin; y < strip_height_ - margin; ++y) {
      for (int x = 0; x < strip_height_ / 2; ++x) {
        const float* const point = exemplar_.Point(exemplar_.TexelAt(patch.turn, patch.u + x, patch.v + y));
        for (int dim = 0; dim < dims; ++dim) {
          sum[dim] += point[dim];
          square += static_cast<double>(point[dim]) * point[dim];
        }
      }
    }
    Statistics statistics;
    double mean_square = 0.0;
    for (int dim = 0; dim < dims; ++dim) {
      const double mean = sum[dim] / count;
      mean_square += mean * mean;
      statistics.mean_distance += (mean - exemplar_.mean()[dim]) * (mean - exemplar_.mean()[dim]);
    }
    statistics.variance = square / count - mean_square;
    return statistics;
  }

  [[nodiscard]] Patch RandomPlace(const std::vector<int>& turns) {
    const int turn = turns[rng_.NextBelow(turns.size())];
    const auto place = [&](int exemplar_side, int sample_side) {
      const int margin = Margin(exemplar_side, sample_side, strip_height_);
      return margin + static_cast<int>(rng_.NextBelow(exemplar_side - sample_side - 2 * margin + 1));
    };
    const int u = place(exemplar_.TurnedWidth(turn), strip_height_ / 2);
    const int v = place(exemplar_.TurnedHeight(turn), strip_height_);
    return spectra_.NextAllowed({turn, u, v}, strip_height_ / 2, strip_height_,
                                Margin(exemplar_.TurnedWidth(turn), strip_height_ / 2, strip_height_),
                                Margin(exemplar_.TurnedHeight(turn), strip_height_, strip_height_));
  }

  [[nodiscard]] bool KeepsMargin(const Patch& patch) const {
    const auto keeps = [&](int at, int exemplar_side, int sample_side) {
      const int margin = Margin(exemplar_side, sample_side, strip_height_);
      return at >= margin && at + sample_side + margin <= exemplar_side;
    };
    return keeps(patch.u, exemplar_.TurnedWidth(patch.turn), strip_height_ / 2) &&
           keeps(patch.v, exemplar_.TurnedHeight(patch.turn), strip_height_);
  }

  [[nodiscard]] size_t Draw(const std::vector<double>& costs, double best) {
    double total = 0.0;
    for (const double cost : costs) {
      total += std::exp(-(cost - best) / kTemperature);
    }
    double draw = rng_.NextDouble() * total;
    for (size_t i = 0; i < costs.size(); ++i) {
      draw -= std::exp(-(costs[i] - best) / kTemperature);
      if (draw < 0.0) {
        return i;
      }
    }
    return costs.size() - 1;
  }

  const ExemplarSpectra& spectra_;
  const Exemplar& exemplar_;
  int strip_height_;
  std::vector<CornerPair> pairs_;
  CandidateSearch search_;
  Rng rng_;
  std::vector<std::vector<int>> turns_;  // [sample]
  std::vector<Patch> samples_;
  std::vector<bool> is_by_hand_;  // [sample]
  Statistics typical_;
  SearchQuery query_;
  BorderCut grid_;
  std::vector<uint32_t> scratch_;
};

}  // namespace

const CornerCut& Corners::cut(const CornerPair& pair) const {
  return *std::find_if(cuts.begin(), cuts.end(), [&](const CornerCut& cut) { return cut.pair == pair; });
}

absl::StatusOr<std::vector<Corners>> ChooseCorners(const ExemplarSpectra& spectra,
                                                   const Arrangement& arrangement, int strip_height,
                                                   uint64_t seed, const RunContext& context,
                                                   const std::vector<std::optional<Patch>>& by_hand) {
  std::vector<Corners> sets(kStarts);
  ParallelFor(context, 0, kStarts, 1, [&](int64_t start, int64_t) {
    CornerSearch search(spectra, arrangement, strip_height, Mix64(seed, static_cast<uint64_t>(start)),
                        by_hand);
    for (int sweep = 0; sweep < kSweeps; ++sweep) {
      for (int sample = 0; sample < search.num_samples(); ++sample) {
        if (context.stop.stop_requested()) {
          return;
        }
        search.Improve(sample, sweep == kSweeps - 1, context.stop);
      }
    }
    sets[start] = search.Result();
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  std::stable_sort(sets.begin(), sets.end(),
                   [](const Corners& a, const Corners& b) { return a.cost < b.cost; });
  return sets;
}

}  // namespace tessera
