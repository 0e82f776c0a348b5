// Where in the exemplar a window of the canvas finds patches like itself: all offsets of all turns at once,
// by cross-correlation of spectra over the embedding, then a choice among the best. Of a large exemplar each
// search sees one region, so that its price is the windows' affair and not the exemplar's.
//
// With weights w and wanted points c, the cost of an offset is sum w |c - e|^2 = sum w |c|^2 - 2 sum (w c) e
// + sum w |e|^2: one correlation a dimension and one with |e|^2, added up as spectra.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "btf/base/rng.h"
#include "btf/base/run_context.h"
#include "btf/tiles/exemplar.h"
#include "btf/tiles/seam_graph.h"

namespace tessera {

// How often each exemplar pixel has been used, whatever the turn. Sums over rectangles in constant time.
class UsageMap {
 public:
  UsageMap(int width, int height);
  // Counts every texel once.
  void Count(std::span<const uint32_t> texels);
  // Call after the last Count, before MeanIn.
  void Finish();
  // Mean uses of a pixel in a rectangle of the turned exemplar, as a multiple of the mean over the whole
  // exemplar; 0 while nothing was counted.
  [[nodiscard]] double RelativeUse(const Patch& patch, int width, int height) const;

 private:
  int width_;
  int height_;
  std::vector<uint32_t> counts_;
  std::vector<uint64_t> sums_;  // [height + 1][width + 1]
};

class FourierTransform;

// Side of the regions for windows of up to two and a half features, in texels.
[[nodiscard]] int RegionSide(const Exemplar& exemplar, int feature_size);

// Transforms of the exemplar in its turns, by regions; shared by all threads.
class ExemplarSpectra {
 public:
  // Regions are at most `region_side` wide and high, of one size, and overlap by a quarter or more.
  // `excluded`, by pixel, is empty or 1 where no patch may lie.
  ExemplarSpectra(const Exemplar& exemplar, const std::vector<int>& turns, int region_side,
                  const RunContext& context, const std::vector<uint8_t>& excluded = {});
  ~ExemplarSpectra();
  ExemplarSpectra(const ExemplarSpectra&) = delete;
  ExemplarSpectra& operator=(const ExemplarSpectra&) = delete;

  [[nodiscard]] const Exemplar& exemplar() const { return *exemplar_; }
  [[nodiscard]] int num_regions() const { return static_cast<int>(regions_.size()); }
  // The shorter side of a region.
  [[nodiscard]] int shorter_side() const { return std::min(region_width_, region_height_); }
  // A region, drawn uniformly; where there is one only, nothing is drawn.
  [[nodiscard]] int DrawRegion(Rng& rng) const;

  [[nodiscard]] bool excludes(uint32_t texel) const {
    return !excluded_.empty() && excluded_[BtfelOfTexel(texel)] != 0;
  }
  // Whether a patch of this size is free of excluded texels; it must lie inside the turned exemplar.
  [[nodiscard]] bool MayBring(const Patch& patch, int width, int height) const {
    return excluded_.empty() || excluded_sums_.RelativeUse(patch, width, height) == 0.0;
  }
  // The first such place in reading order at or after `patch`, going round, that leaves `margin` texels to
  // the rim of the turned exemplar; `patch` itself where there is none.
  [[nodiscard]] Patch NextAllowed(const Patch& patch, int width, int height, int margin_u,
                                  int margin_v) const;

 private:
  friend class CandidateSearch;

  [[nodiscard]] int TurnedRegionWidth(int turn) const {
    return (turn & 1) == 0 ? region_width_ : region_height_;
  }
  [[nodiscard]] int TurnedRegionHeight(int turn) const {
    return (turn & 1) == 0 ? region_height_ : region_width_;
  }
  // The region's first column and row in the turned exemplar.
  [[nodiscard]] std::array<int, 2> TurnedRegionOrigin(int turn, int region) const;

  const Exemplar* exemplar_;
  std::vector<uint8_t> excluded_;
  UsageMap excluded_sums_;
  int region_width_ = 0;
  int region_height_ = 0;
  std::vector<std::array<int, 2>> regions_;  // first column and row, unturned
  int channels_ = 0;                         // search dimensions and the squared length
  std::unique_ptr<FourierTransform> transform_;
  std::vector<std::vector<Eigen::MatrixXf>> spectra_;  // [turn][region], empty for a turn not asked for
};

// What a window wants: points and weights by texel.
struct SearchQuery {
  int width = 0;
  int height = 0;
  std::vector<float> weights;  // [height][width], >= 0; where all are 0, every patch costs 0
  std::vector<float> wanted;   // [height][width][search_dims]
};

struct Candidate {
  Patch patch;
  double cost = 0.0;  // weighted mean squared distance / the exemplar's spread, with the price of repetition
};

// One per thread.
class CandidateSearch {
 public:
  explicit CandidateSearch(const ExemplarSpectra& spectra);
  ~CandidateSearch();

  // At most `count` candidates in the region among `turns`, best first, no two within `separation` texels of
  // each other in both axes of the same turn. `usage` may be null; a patch used twice as often as the mean
  // costs `repetition` more. Empty when the window fits no turn or after a stop request.
  std::vector<Candidate> Search(const SearchQuery& query, int region, const std::vector<int>& turns,
                                const UsageMap* usage, double repetition, int count, int separation,
                                const std::stop_token& stop);

 private:
  // A stretch of correlations_: rows of num_u offsets, the first of them `first`.
  struct OffsetsOfTurn {
    Patch first;
    int num_u = 0;
    size_t begin = 0;
    size_t end = 0;
    [[nodiscard]] Patch PatchAt(size_t index) const {
      const auto i = static_cast<int>(index - begin);
      return {first.turn, first.u + i % num_u, first.v + i / num_u};
    }
  };

  // Fills correlations_ and of_turns_. Returns how many offsets may be taken, 0 after a stop request.
  size_t Correlate(const SearchQuery& query, int region, const std::vector<int>& turns,
                   const std::stop_token& stop);

  const ExemplarSpectra* spectra_;
  Eigen::MatrixXf channel_, lines_, query_spectrum_, sum_, columns_, correlation_;
  // Costs of all offsets but for a constant and a factor; infinite where no patch may lie.
  std::vector<float> correlations_;
  std::vector<OffsetsOfTurn> of_turns_;
  std::vector<float> sample_;
  std::vector<Candidate> offsets_;
};

// Draws `count` candidates without replacement. One whose cost exceeds the best by the share `temperature` of
// it has 1/e of its chance.
std::vector<Candidate> SampleCandidates(std::vector<Candidate> candidates, int count, double temperature,
                                        Rng& rng);

}  // namespace tessera
