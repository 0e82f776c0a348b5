// Where in the exemplar a window of the canvas finds patches like itself: all offsets of all turns at once,
// by FFT cross-correlation over the embedding, then a choice among the best.
//
// With weights w and wanted points c, the cost of an offset is sum w |c - e|^2 = sum w |c|^2 - 2 sum (w c) e
// + sum w |e|^2: one correlation a dimension and one with |e|^2. Channels are correlated in pairs: the real
// part of corr(q1 + i q2, e1 + i e2) is corr(q1, e1) + corr(q2, e2).
#pragma once

#include <complex>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "btf/base/rng.h"
#include "btf/base/run_context.h"
#include "btf/tiles/exemplar.h"
#include "btf/tiles/seam_graph.h"

namespace tessera {

// Transforms of the exemplar in its turns, and the plans; shared by all threads.
class ExemplarSpectra {
 public:
  ExemplarSpectra(const Exemplar& exemplar, const std::vector<int>& turns, const RunContext& context);
  ~ExemplarSpectra();
  ExemplarSpectra(const ExemplarSpectra&) = delete;
  ExemplarSpectra& operator=(const ExemplarSpectra&) = delete;

  [[nodiscard]] const Exemplar& exemplar() const { return *exemplar_; }

 private:
  friend class CandidateSearch;
  struct Plans;
  const Exemplar* exemplar_;
  int size_ = 0;      // of the square transform
  int channels_ = 0;  // complex ones
  std::unique_ptr<Plans> plans_;
  std::vector<std::vector<std::complex<float>>> spectra_;  // [turn], empty for a turn not asked for
};

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

  // At most `count` candidates among `turns`, best first, no two within `separation` texels of each other in
  // both axes of the same turn. `usage` may be null; a patch used twice as often as the mean costs
  // `repetition` more. Empty when the window fits no turn or after a stop request.
  std::vector<Candidate> Search(const SearchQuery& query, const std::vector<int>& turns,
                                const UsageMap* usage, double repetition, int count, int separation,
                                const std::stop_token& stop);

 private:
  const ExemplarSpectra* spectra_;
  std::vector<std::complex<float>> plane_, turned_plane_, sum_;
  std::vector<std::vector<std::complex<float>>> query_spectra_;  // [channel]
  std::vector<std::complex<float>> line_;
  std::vector<Candidate> offsets_;
};

// Draws `count` candidates without replacement. One whose cost exceeds the best by the share `temperature` of
// it has 1/e of its chance.
std::vector<Candidate> SampleCandidates(std::vector<Candidate> candidates, int count, double temperature,
                                        Rng& rng);

}  // namespace tessera
