#include "btf/tiles/candidates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <tuple>

#include <kiss_fft.h>

#include "btf/base/parallel.h"

namespace tessera {
namespace {

using Complex = std::complex<float>;

// Elements beyond a line, so that the columns of a power of two do not fall into one cache set.
constexpr int kLinePadding = 8;

// Regions, in texels: windows of three features leave a quarter of four to move in, and an exemplar of the
// usual size is one. A very large exemplar has larger ones, lest their spectra outgrow it.
constexpr int kSmallestRegion = 128;
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

// kiss_fft_cpx and std::complex<float> are both two floats.
static_assert(sizeof(kiss_fft_cpx) == sizeof(Complex));

void Transform(kiss_fft_cfg plan, const Complex* in, Complex* out, int in_stride) {
  kiss_fft_stride(plan, reinterpret_cast<const kiss_fft_cpx*>(in), reinterpret_cast<kiss_fft_cpx*>(out),
                  in_stride);
}

// The value of search channel `channel` (dimensions, then the squared length, then 0) of a texel.
float ChannelValue(const Exemplar& exemplar, uint32_t texel, int channel) {
  const float* const point = exemplar.Point(texel);
  const int dims = exemplar.search_dims();
  if (channel < dims) {
    return point[channel];
  }
  if (channel > dims) {
    return 0.0f;
  }
  float square = 0.0f;
  for (int dim = 0; dim < dims; ++dim) {
    square += point[dim] * point[dim];
  }
  return square;
}

// Two-dimensional transform of the first `rows` rows of `plane` (the others are 0), left transposed in `out`.
void Forward2d(kiss_fft_cfg plan, int size, int rows, std::vector<Complex>& plane, std::vector<Complex>& line,
               std::vector<Complex>& out) {
  const int stride = size + kLinePadding;
  for (int y = 0; y < rows; ++y) {
    Transform(plan, plane.data() + static_cast<size_t>(y) * stride, line.data(), 1);
    std::copy_n(line.data(), size, plane.data() + static_cast<size_t>(y) * stride);
  }
  for (int x = 0; x < size; ++x) {
    Transform(plan, plane.data() + x, out.data() + static_cast<size_t>(x) * stride, stride);
  }
}

}  // namespace

struct ExemplarSpectra::Plans {
  kiss_fft_cfg forward = nullptr;
  kiss_fft_cfg inverse = nullptr;
  explicit Plans(int size)
      : forward(kiss_fft_alloc(size, 0, nullptr, nullptr)),
        inverse(kiss_fft_alloc(size, 1, nullptr, nullptr)) {}
  ~Plans() {
    kiss_fft_free(forward);
    kiss_fft_free(inverse);
  }
};

int RegionSide(const Exemplar& exemplar, int feature_size) {
  const int longer = std::max(exemplar.width(), exemplar.height());
  return std::max({kSmallestRegion, kRegionFeatures * feature_size, longer / kMaxRegionsAcross});
}

ExemplarSpectra::ExemplarSpectra(const Exemplar& exemplar, const std::vector<int>& turns, int region_side,
                                 const RunContext& context)
    : exemplar_(&exemplar),
      region_width_(std::min(exemplar.width(), region_side)),
      region_height_(std::min(exemplar.height(), region_side)),
      size_(kiss_fft_next_fast_size(std::max(region_width_, region_height_))),
      channels_((exemplar.search_dims() + 2) / 2),
      plans_(std::make_unique<Plans>(size_)),
      spectra_(4) {
  for (const int y : RegionStarts(exemplar.height(), region_height_)) {
    for (const int x : RegionStarts(exemplar.width(), region_width_)) {
      regions_.push_back({x, y});
    }
  }
  const size_t plane_size = static_cast<size_t>(size_) * (size_ + kLinePadding);
  for (const int turn : turns) {
    spectra_[turn].resize(plane_size * channels_ * regions_.size());
  }
  const auto num_turns = static_cast<int64_t>(turns.size());
  const int64_t per_turn = int64_t{num_regions()} * channels_;
  ParallelFor(context, 0, num_turns * per_turn, 1, [&](int64_t begin, int64_t) {
    const int turn = turns[begin / per_turn];
    const auto region = static_cast<int>(begin % per_turn / channels_);
    const int channel = static_cast<int>(begin % channels_);
    std::vector<Complex> plane(plane_size);
    std::vector<Complex> line(size_);
    std::vector<Complex> out(plane_size);
    const auto [first_u, first_v] = TurnedRegionOrigin(turn, region);
    for (int v = 0; v < TurnedRegionHeight(turn); ++v) {
      for (int u = 0; u < TurnedRegionWidth(turn); ++u) {
        const uint32_t texel = exemplar.TexelAt(turn, first_u + u, first_v + v);
        plane[static_cast<size_t>(v) * (size_ + kLinePadding) + u] = {
            ChannelValue(exemplar, texel, 2 * channel), ChannelValue(exemplar, texel, 2 * channel + 1)};
      }
    }
    Forward2d(plans_->forward, size_, TurnedRegionHeight(turn), plane, line, out);
    std::copy(out.begin(), out.end(), spectra_[turn].begin() + begin % per_turn * plane_size);
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

CandidateSearch::CandidateSearch(const ExemplarSpectra& spectra)
    : spectra_(&spectra),
      plane_(static_cast<size_t>(spectra.size_) * (spectra.size_ + kLinePadding)),
      turned_plane_(plane_.size()),
      sum_(plane_.size()),
      query_spectra_(spectra.channels_, std::vector<Complex>(plane_.size())),
      line_(spectra.size_) {}

CandidateSearch::~CandidateSearch() = default;

std::vector<Candidate> CandidateSearch::Search(const SearchQuery& query, int region,
                                               const std::vector<int>& turns, const UsageMap* usage,
                                               double repetition, int count, int separation,
                                               const std::stop_token& stop) {
  const Exemplar& exemplar = spectra_->exemplar();
  const int size = spectra_->size_;
  const int stride = size + kLinePadding;
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

  const auto query_value = [&](int i, int channel) {
    if (channel < dims) {
      return -2.0f * query.weights[i] * query.wanted[static_cast<size_t>(i) * dims + channel];
    }
    return channel == dims ? query.weights[i] : 0.0f;
  };
  for (int channel = 0; channel < spectra_->channels_; ++channel) {
    if (stop.stop_requested()) {
      return {};
    }
    std::fill(plane_.begin(), plane_.end(), Complex{});
    for (int y = 0; y < query.height; ++y) {
      for (int x = 0; x < query.width; ++x) {
        const int i = y * query.width + x;
        plane_[static_cast<size_t>(y) * stride + x] = {query_value(i, 2 * channel),
                                                       query_value(i, 2 * channel + 1)};
      }
    }
    Forward2d(spectra_->plans_->forward, size, query.height, plane_, line_, query_spectra_[channel]);
  }

  offsets_.clear();
  const double scale = 1.0 / (static_cast<double>(size) * size);
  for (const int turn : turns) {
    const int num_u = spectra_->TurnedRegionWidth(turn) - query.width + 1;
    const int num_v = spectra_->TurnedRegionHeight(turn) - query.height + 1;
    if (num_u <= 0 || num_v <= 0) {
      continue;
    }
    if (stop.stop_requested()) {
      return {};
    }
    std::fill(sum_.begin(), sum_.end(), Complex{});
    for (int channel = 0; channel < spectra_->channels_; ++channel) {
      const float* q = reinterpret_cast<const float*>(query_spectra_[channel].data());
      const float* e = reinterpret_cast<const float*>(
          spectra_->spectra_[turn].data() +
          (static_cast<size_t>(region) * spectra_->channels_ + channel) * plane_.size());
      float* s = reinterpret_cast<float*>(sum_.data());
      const size_t length = 2 * plane_.size();
      for (size_t i = 0; i < length; i += 2) {
        s[i] += q[i] * e[i] + q[i + 1] * e[i + 1];
        s[i + 1] += q[i] * e[i + 1] - q[i + 1] * e[i];
      }
    }
    // Lines of the spectrum are columns of the plane: transform along v first, then along u for the rows in
    // use.
    for (int x = 0; x < size; ++x) {
      Transform(spectra_->plans_->inverse, sum_.data() + static_cast<size_t>(x) * stride, line_.data(), 1);
      std::copy_n(line_.data(), size, turned_plane_.data() + static_cast<size_t>(x) * stride);
    }
    const auto [first_u, first_v] = spectra_->TurnedRegionOrigin(turn, region);
    for (int v = 0; v < num_v; ++v) {
      Transform(spectra_->plans_->inverse, turned_plane_.data() + v, line_.data(), stride);
      for (int u = 0; u < num_u; ++u) {
        const double squares = std::max(0.0, wanted_square + line_[u].real() * scale);
        offsets_.push_back({Patch{turn, first_u + u, first_v + v}, squares / norm});
      }
    }
  }

  // A generous prefix in order of cost, thinned so that no two are near each other.
  const size_t prefix =
      std::min(offsets_.size(), static_cast<size_t>(count) * (2 * separation + 1) * (2 * separation + 1));
  const auto before = [](const Candidate& a, const Candidate& b) {
    return a.cost != b.cost ? a.cost < b.cost
                            : std::tuple(a.patch.turn, a.patch.v, a.patch.u) <
                                  std::tuple(b.patch.turn, b.patch.v, b.patch.u);
  };
  const auto add_repetition = [&](Candidate& offset) {
    offset.cost *= 1.0 + repetition * usage->RelativeUse(offset.patch, query.width, query.height);
  };
  size_t num_ordered = offsets_.size();
  if (usage != nullptr && prefix < offsets_.size()) {
    // Repetition only adds: no offset is among the best that costs more without it than so many do with it.
    const auto end = offsets_.begin() + static_cast<std::ptrdiff_t>(prefix);
    std::nth_element(offsets_.begin(), end, offsets_.end(), before);
    std::for_each(offsets_.begin(), end, add_repetition);
    const double bound = std::max_element(offsets_.begin(), end, before)->cost;
    const auto dear =
        std::partition(end, offsets_.end(), [&](const Candidate& offset) { return offset.cost <= bound; });
    std::for_each(end, dear, add_repetition);
    num_ordered = static_cast<size_t>(dear - offsets_.begin());
  } else if (usage != nullptr) {
    std::for_each(offsets_.begin(), offsets_.end(), add_repetition);
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
