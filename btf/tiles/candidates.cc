#include "btf/tiles/candidates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <tuple>

#include "btf/base/parallel.h"
#include "btf/tiles/fourier_transform.h"

namespace tessera {
namespace {

// Regions, in texels: first windows leave more than a quarter of four features to move in, and an exemplar of
// the usual size is one. A very large exemplar has larger ones, lest their spectra outgrow it.
constexpr int kLargestWhole = 128;
constexpr int kSmallestRegion = 96;
constexpr int kRegionFeatures = 4;
constexpr int kMaxRegionsAcross = 4;

// First texels of regions of `side` texels that cover `extent`, evenly spaced.
std::vector<int> RegionStarts(int extent, int side) {
  const int stride = std::max(1, side * 3 / 4);
  const int count = (extent - side + stride - 1) / stride + 1;
  std::vector<int> starts;
  for (int i = 0; i < count; ++i) {
    starts.push_back(count == 1 ? 0 : i * (extent - side) / (count - 1));
  }
  return starts;
}

// The value of search channel `channel` (dimensions, then the squared length) of a texel.
float ChannelValue(const Exemplar& exemplar, uint32_t texel, int channel) {
  const float* const point = exemplar.Point(texel);
  const int dims = exemplar.search_dims();
  if (channel < dims) {
    return point[channel];
  }
  float square = 0.0f;
  for (int dim = 0; dim < dims; ++dim) {
    square += point[dim] * point[dim];
  }
  return square;
}

// Adds the product of the conjugate of `query` with `exemplar`, channel by channel.
void AddCorrelation(const Eigen::MatrixXf& query, const Eigen::MatrixXf& exemplar, int channels,
                    Eigen::MatrixXf& sum) {
  const Eigen::Index size = sum.rows() / 2;
  const Eigen::Index columns = sum.cols();
  for (Eigen::Index k = 0; k < columns; ++k) {
    auto real = sum.col(k).head(size).array();
    auto imaginary = sum.col(k).tail(size).array();
    for (int channel = 0; channel < channels; ++channel) {
      const auto q = query.col(channel * columns + k).array();
      const auto e = exemplar.col(channel * columns + k).array();
      real += q.head(size) * e.head(size) + q.tail(size) * e.tail(size);
      imaginary += q.head(size) * e.tail(size) - q.tail(size) * e.head(size);
    }
  }
}

// A value that at least `count` of `values` do not exceed, and not many more, but for the largest float.
float BoundOfLeast(const std::vector<float>& values, size_t count, std::vector<float>& sample) {
  constexpr size_t kStride = 13;
  constexpr size_t kSpare = 8;
  sample.clear();
  for (size_t i = 0; i < values.size(); i += kStride) {
    sample.push_back(values[i]);
  }
  for (size_t rank = count * 5 / 4 / kStride + kSpare; rank < sample.size(); rank *= 2) {
    const auto bound = sample.begin() + static_cast<std::ptrdiff_t>(rank);
    std::nth_element(sample.begin(), bound, sample.end());
    if (std::isfinite(*bound) && static_cast<size_t>(std::ranges::count_if(
                                     values, [&](float value) { return value <= *bound; })) >= count) {
      return *bound;
    }
  }
  return std::numeric_limits<float>::max();
}

// Above `value` by a rounding or two.
float FloatAbove(double value) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  return std::min(std::nextafter(std::nextafter(static_cast<float>(value), kInfinity), kInfinity),
                  std::numeric_limits<float>::max());
}

}  // namespace

int RegionSide(const Exemplar& exemplar, int feature_size) {
  const int longer = std::max(exemplar.width(), exemplar.height());
  if (longer <= kLargestWhole) {
    return longer;
  }
  return std::max({kSmallestRegion, kRegionFeatures * feature_size, longer / kMaxRegionsAcross});
}

ExemplarSpectra::ExemplarSpectra(const Exemplar& exemplar, const std::vector<int>& turns, int region_side,
                                 const RunContext& context, const std::vector<uint8_t>& excluded)
    : exemplar_(&exemplar),
      excluded_(excluded),
      excluded_sums_(exemplar.width(), exemplar.height()),
      region_width_(std::min(exemplar.width(), region_side)),
      region_height_(std::min(exemplar.height(), region_side)),
      channels_(exemplar.search_dims() + 1),
      transform_(std::make_unique<FourierTransform>(std::max(region_width_, region_height_))),
      spectra_(4) {
  for (uint32_t pixel = 0; pixel < excluded_.size(); ++pixel) {
    if (excluded_[pixel] != 0) {
      excluded_sums_.Count({&pixel, 1});
    }
  }
  excluded_sums_.Finish();
  for (const int y : RegionStarts(exemplar.height(), region_height_)) {
    for (const int x : RegionStarts(exemplar.width(), region_width_)) {
      regions_.push_back({x, y});
    }
  }
  for (const int turn : turns) {
    spectra_[turn].resize(regions_.size());
  }
  const auto num_turns = static_cast<int64_t>(turns.size());
  ParallelFor(context, 0, num_turns * num_regions(), 1, [&](int64_t begin, int64_t) {
    const int turn = turns[begin / num_regions()];
    const auto region = static_cast<int>(begin % num_regions());
    const auto [first_u, first_v] = TurnedRegionOrigin(turn, region);
    Eigen::MatrixXf plane(TurnedRegionHeight(turn), TurnedRegionWidth(turn));
    Eigen::MatrixXf lines(2 * plane.rows(), channels_ * transform_->columns());
    for (int channel = 0; channel < channels_; ++channel) {
      for (int u = 0; u < plane.cols(); ++u) {
        for (int v = 0; v < plane.rows(); ++v) {
          plane(v, u) = ChannelValue(exemplar, exemplar.TexelAt(turn, first_u + u, first_v + v), channel);
        }
      }
      transform_->Across(plane, channel, lines);
    }
    transform_->Down(lines, spectra_[turn][region]);
  });
}

ExemplarSpectra::~ExemplarSpectra() = default;

int ExemplarSpectra::DrawRegion(Rng& rng) const {
  return num_regions() == 1 ? 0 : static_cast<int>(rng.NextBelow(regions_.size()));
}

std::array<int, 2> ExemplarSpectra::TurnedRegionOrigin(int turn, int region) const {
  const auto [x, y] = regions_[region];
  const int right = exemplar_->width() - x - region_width_;
  const int below = exemplar_->height() - y - region_height_;
  const std::array<std::array<int, 2>, 4> of_turn = {{{x, y}, {y, right}, {right, below}, {below, x}}};
  return of_turn[turn];
}

Patch ExemplarSpectra::NextAllowed(const Patch& patch, int width, int height, int margin_u,
                                   int margin_v) const {
  const int num_u = exemplar_->TurnedWidth(patch.turn) - width - 2 * margin_u + 1;
  const int num_v = exemplar_->TurnedHeight(patch.turn) - height - 2 * margin_v + 1;
  const int first = (patch.v - margin_v) * num_u + patch.u - margin_u;
  for (int step = 0; step < num_u * num_v; ++step) {
    const int place = (first + step) % (num_u * num_v);
    const Patch next{patch.turn, margin_u + place % num_u, margin_v + place / num_u};
    if (MayBring(next, width, height)) {
      return next;
    }
  }
  return patch;
}

UsageMap::UsageMap(int width, int height)
    : width_(width),
      height_(height),
      counts_(static_cast<size_t>(width) * height, 0),
      sums_(static_cast<size_t>(width + 1) * (height + 1), 0) {}

void UsageMap::Count(std::span<const uint32_t> texels) {
  for (const uint32_t texel : texels) {
    if (texel != kNoTexel) {
      ++counts_[BtfelOfTexel(texel)];
    }
  }
}

void UsageMap::Finish() {
  for (int y = 0; y < height_; ++y) {
    uint64_t row = 0;
    for (int x = 0; x < width_; ++x) {
      row += counts_[static_cast<size_t>(y) * width_ + x];
      sums_[static_cast<size_t>(y + 1) * (width_ + 1) + x + 1] =
          sums_[static_cast<size_t>(y) * (width_ + 1) + x + 1] + row;
    }
  }
}

double UsageMap::RelativeUse(const Patch& patch, int width, int height) const {
  const uint64_t total = sums_.back();
  if (total == 0) {
    return 0.0;
  }
  const bool lying = (patch.turn & 1) != 0;
  const int across = lying ? height : width;
  const int down = lying ? width : height;
  const std::array<int, 4> x_of_turn = {patch.u, width_ - patch.v - height, width_ - patch.u - width,
                                        patch.v};
  const std::array<int, 4> y_of_turn = {patch.v, patch.u, height_ - patch.v - height,
                                        height_ - patch.u - width};
  const int x0 = x_of_turn[patch.turn];
  const int y0 = y_of_turn[patch.turn];
  const auto sum = [&](int x, int y) { return sums_[static_cast<size_t>(y) * (width_ + 1) + x]; };
  const uint64_t uses = sum(x0 + across, y0 + down) - sum(x0, y0 + down) - sum(x0 + across, y0) + sum(x0, y0);
  const double mean = static_cast<double>(total) / (static_cast<double>(width_) * height_);
  return static_cast<double>(uses) / (static_cast<double>(width) * height) / mean;
}

CandidateSearch::CandidateSearch(const ExemplarSpectra& spectra) : spectra_(&spectra) {}

CandidateSearch::~CandidateSearch() = default;

size_t CandidateSearch::Correlate(const SearchQuery& query, int region, const std::vector<int>& turns,
                                  const std::stop_token& stop) {
  const FourierTransform& transform = *spectra_->transform_;
  const int dims = spectra_->exemplar().search_dims();
  channel_.resize(query.height, query.width);
  lines_.resize(2 * query.height, spectra_->channels_ * transform.columns());
  for (int channel = 0; channel < spectra_->channels_; ++channel) {
    if (stop.stop_requested()) {
      return 0;
    }
    for (int x = 0; x < query.width; ++x) {
      for (int y = 0; y < query.height; ++y) {
        const size_t i = static_cast<size_t>(y) * query.width + x;
        channel_(y, x) =
            channel < dims ? -2.0f * query.weights[i] * query.wanted[i * dims + channel] : query.weights[i];
      }
    }
    transform.Across(channel_, channel, lines_);
  }
  transform.Down(lines_, query_spectrum_);

  size_t num_offsets = 0;
  of_turns_.clear();
  correlations_.clear();
  for (const int turn : turns) {
    const int num_u = spectra_->TurnedRegionWidth(turn) - query.width + 1;
    const int num_v = spectra_->TurnedRegionHeight(turn) - query.height + 1;
    if (num_u <= 0 || num_v <= 0) {
      continue;
    }
    if (stop.stop_requested()) {
      return 0;
    }
    sum_.setZero(2 * transform.size(), transform.columns());
    AddCorrelation(query_spectrum_, spectra_->spectra_[turn][region], spectra_->channels_, sum_);
    transform.Back(sum_, num_u, num_v, columns_, correlation_);
    const size_t begin = correlations_.size();
    correlations_.insert(correlations_.end(), correlation_.data(), correlation_.data() + correlation_.size());
    const auto [first_u, first_v] = spectra_->TurnedRegionOrigin(turn, region);
    const OffsetsOfTurn& added =
        of_turns_.emplace_back(OffsetsOfTurn{{turn, first_u, first_v}, num_u, begin, correlations_.size()});
    num_offsets += added.end - added.begin;
    for (size_t i = added.begin; !spectra_->excluded_.empty() && i < added.end; ++i) {
      if (!spectra_->MayBring(added.PatchAt(i), query.width, query.height)) {
        correlations_[i] = std::numeric_limits<float>::infinity();
        --num_offsets;
      }
    }
  }
  return num_offsets;
}

std::vector<Candidate> CandidateSearch::Search(const SearchQuery& query, int region,
                                               const std::vector<int>& turns, const UsageMap* usage,
                                               double repetition, int count, int separation,
                                               const std::stop_token& stop) {
  const Exemplar& exemplar = spectra_->exemplar();
  const int dims = exemplar.search_dims();
  const int num_texels = query.width * query.height;

  double weight_sum = 0.0;
  double wanted_square = 0.0;
  for (int i = 0; i < num_texels; ++i) {
    weight_sum += query.weights[i];
    double square = 0.0;
    for (int dim = 0; dim < dims; ++dim) {
      const double value = query.wanted[static_cast<size_t>(i) * dims + dim];
      square += value * value;
    }
    wanted_square += query.weights[i] * square;
  }
  const double norm = exemplar.search_spread() * (weight_sum > 0.0 ? weight_sum : 1.0);
  const size_t num_offsets = Correlate(query, region, turns, stop);

  // A generous prefix in order of cost, thinned so that no two are near each other. Few offsets are cheap
  // enough to be looked at one by one.
  const size_t prefix =
      std::min(num_offsets, static_cast<size_t>(count) * (2 * separation + 1) * (2 * separation + 1));
  if (prefix == 0) {
    return {};
  }
  offsets_.clear();
  const auto add_offsets = [&](float above, float most) {
    for (const OffsetsOfTurn& of_turn : of_turns_) {
      for (size_t i = of_turn.begin; i < of_turn.end; ++i) {
        if (correlations_[i] > above && correlations_[i] <= most) {
          const double squares = std::max(0.0, wanted_square + double{correlations_[i]});
          offsets_.push_back({of_turn.PatchAt(i), squares / norm});
        }
      }
    }
  };
  // Beside the prefix all offsets that cost nothing, for those are as good as each other.
  const float most =
      std::max(BoundOfLeast(correlations_, prefix, sample_), static_cast<float>(-wanted_square));
  add_offsets(-std::numeric_limits<float>::infinity(), most);
  const auto before = [](const Candidate& a, const Candidate& b) {
    return a.cost != b.cost ? a.cost < b.cost
                            : std::tuple(a.patch.turn, a.patch.v, a.patch.u) <
                                  std::tuple(b.patch.turn, b.patch.v, b.patch.u);
  };
  size_t num_ordered = offsets_.size();
  if (usage != nullptr) {
    const auto add_repetition = [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        offsets_[i].cost *=
            1.0 + repetition * usage->RelativeUse(offsets_[i].patch, query.width, query.height);
      }
    };
    const auto at = [&](size_t index) { return offsets_.begin() + static_cast<std::ptrdiff_t>(index); };
    // Repetition only adds: no offset is among the best that costs more without it than so many do with it.
    std::nth_element(at(0), at(prefix), offsets_.end(), before);
    add_repetition(0, prefix);
    const double bound = std::max_element(at(0), at(prefix), before)->cost;
    add_offsets(most, FloatAbove(bound * norm - wanted_square));
    const auto dear = std::partition(at(prefix), offsets_.end(),
                                     [&](const Candidate& offset) { return offset.cost <= bound; });
    num_ordered = static_cast<size_t>(dear - at(0));
    add_repetition(prefix, num_ordered);
  }
  const auto ordered_end = offsets_.begin() + static_cast<std::ptrdiff_t>(num_ordered);
  const auto prefix_end = offsets_.begin() + static_cast<std::ptrdiff_t>(prefix);
  std::nth_element(offsets_.begin(), prefix_end, ordered_end, before);
  std::sort(offsets_.begin(), prefix_end, before);
  std::vector<Candidate> best;
  for (size_t i = 0; i < prefix && static_cast<int>(best.size()) < count; ++i) {
    const Patch& patch = offsets_[i].patch;
    const bool crowded = std::any_of(best.begin(), best.end(), [&](const Candidate& other) {
      return other.patch.turn == patch.turn && std::abs(other.patch.u - patch.u) <= separation &&
             std::abs(other.patch.v - patch.v) <= separation;
    });
    if (!crowded) {
      best.push_back(offsets_[i]);
    }
  }
  return best;
}

std::vector<Candidate> SampleCandidates(std::vector<Candidate> candidates, int count, double temperature,
                                        Rng& rng) {
  std::vector<Candidate> chosen;
  if (candidates.empty()) {
    return chosen;
  }
  double best = candidates.front().cost;
  for (const Candidate& candidate : candidates) {
    best = std::min(best, candidate.cost);
  }
  constexpr double kSmallestCost = 1e-9;  // an exact match: its likes still have a chance
  const double scale = temperature * std::max(best, kSmallestCost);
  while (static_cast<int>(chosen.size()) < count && !candidates.empty()) {
    std::vector<double> chance(candidates.size());
    double total = 0.0;
    for (size_t i = 0; i < candidates.size(); ++i) {
      chance[i] = std::exp(-(candidates[i].cost - best) / scale);
      total += chance[i];
    }
    double draw = rng.NextDouble() * total;
    size_t pick = 0;
    while (pick + 1 < candidates.size() && draw >= chance[pick]) {
      draw -= chance[pick];
      ++pick;
    }
    chosen.push_back(candidates[pick]);
    candidates.erase(candidates.begin() + static_cast<std::ptrdiff_t>(pick));
  }
  return chosen;
}

}  // namespace tessera
