// The certificate of a tile set: how visible its seams are, in reflectance, against the material's own
// changes from texel to texel; what random cuts would score instead; and how much the tiles repeat.
//
// A pair of 4-neighbours (p, q) of the output is cut when their sources a, b do not continue each other. a'
// is where q would lie in p's patch, b' where p would lie in q's. In image i (one view and light), with |.|
// the Euclidean distance of RGB and every texel seen in its own turn,
//
//   s = |x_i(a) - x_i(b)|,  n = (|x_i(a) - x_i(a')| + |x_i(b') - x_i(b)|) / 2,
//   R = sum (s + eps) / sum (n + eps),
//
// eps = 1% of the mean distance of neighbours in image i of the exemplar, so that a cut which changes nothing
// scores exactly 1, where the material is flat as well. Where a' or b' falls off the exemplar, n is the other
// one's; where both do, it is that mean distance. Borders are the pairs across the common side of two tiles,
// over all legal pairs of tiles and turns; insides are all pairs within a tile.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/base/run_context.h"
#include "btf/codec/decoder.h"
#include "btf/codec/material.h"
#include "btf/tiles/exemplar.h"
#include "btf/tiles/index_maps.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/tile_set.h"

namespace tessera {

// Which images of the material, by its measured views and lights, a certificate looks at.
enum class CertificateImages {
  kStratified,  // kCertificateImages of them, spread over both; all where there are fewer
  kAll
};
inline constexpr int kCertificateImages = 256;

struct ImagePair {
  int view = 0;
  int light = 0;
};

// Stratified: views and lights, each in the order given, fall into 16 equal parts (more where the other has
// fewer than 16); one pair is drawn from every part of views and of lights.
[[nodiscard]] std::vector<ImagePair> ChooseImages(int num_views, int num_lights, CertificateImages which);

// One view and light of the exemplar: RGB by [turn][pixel], turns that do not occur may be empty.
struct ExemplarImage {
  std::array<std::vector<float>, 4> rgb;
};

// Decodes images[i] under pairs[i], all texels, in those turns whose `rgb` has room for them already.
void DecodeExemplarImages(const Decoder& decoder, const BtfelTable& table, std::span<const ImagePair> pairs,
                          const RunContext& context, std::span<ExemplarImage> images);

// A cut pair, q in `direction` (GridCut::Direction) from p.
struct CutPair {
  uint32_t a = 0;
  uint32_t b = 0;
  int direction = 0;
  double weight = 1.0;
};

// The cut pairs of one kind, and among how many they were found.
struct Seams {
  std::vector<CutPair> pairs;
  double num_pairs = 0.0;  // weighted, cut or not
  int longest_run = 0;     // verbatim, in texels
  // First pairs of runs of kSeamRun pairs that follow each other along one border, or down and across one
  // tile.
  std::vector<size_t> run_starts;
  // (pair, index of an output texel that it touches), for the heat map.
  std::vector<std::pair<uint32_t, uint32_t>> places;
};
inline constexpr int kSeamRun = 8;

// All pairs within tiles, and all across borders.
[[nodiscard]] Seams InsideSeams(const Exemplar& exemplar, const IndexMaps& maps);
[[nodiscard]] Seams BorderSeams(const Exemplar& exemplar, const Arrangement& arrangement,
                                const IndexMaps& maps);

// The sums of R over images given in batches, so that memory holds few of them.
class SeamMeter {
 public:
  struct Sums {
    double step = 0.0;     // sum of weight (s + eps)
    double natural = 0.0;  // sum of weight (n + eps)
    [[nodiscard]] double ratio() const { return natural > 0.0 ? step / natural : 1.0; }
  };

  // `exemplar` must outlive the meter.
  SeamMeter(const Exemplar& exemplar, Seams seams);

  // The same sums for any number of threads.
  void Add(std::span<const ExemplarImage> images, const RunContext& context);

  // R pooled over images.
  [[nodiscard]] double Ratio() const;
  // Keys: ratio (pooled), ratio_p95 and ratio_worst (over images), ratio_run_p95 (over runs; R pooled over
  // images), cut_share (of pairs), verbatim_share (1 - cut_share), longest_verbatim_run. All ratios are 1
  // where nothing is cut.
  [[nodiscard]] nlohmann::json Describe() const;

  [[nodiscard]] const Seams& seams() const { return seams_; }
  [[nodiscard]] const Sums& of_pair(size_t pair) const { return by_pair_[pair]; }

 private:
  const Exemplar* exemplar_;
  Seams seams_;
  std::vector<Sums> by_pair_;
  std::vector<Sums> by_image_;
};

// As Certificate::heat, of meters whose seams have places among `num_texels`.
[[nodiscard]] std::vector<uint8_t> HeatOf(std::span<const SeamMeter* const> meters, size_t num_texels);

struct Certificate {
  // Keys: images {count, of, rule}; referenced_share (of the exemplar's texels); `borders` and `insides` as
  // SeamMeter describes them; controls {false_cuts, random_minimum_cuts, random_straight_cuts} with R of
  // seam_controls.h; repetition (repetition.h).
  nlohmann::json figures;
  // R of the cut pairs of each output texel pooled over images, [tiles][w][w]: 0 where none is cut, else
  // kHeatOfOne times R, rounded into 1..255.
  std::vector<uint8_t> heat;
};
inline constexpr int kHeatOfOne = 64;

// Decodes the images from `material`, whose embedding `exemplar` is. Progress in stage "certificate", images.
// Errors: INVALID_ARGUMENT or UNIMPLEMENTED from the decoder, CANCELLED.
[[nodiscard]] absl::StatusOr<Certificate> CertifyTiles(const Material& material, const Exemplar& exemplar,
                                                       const Arrangement& arrangement, const IndexMaps& maps,
                                                       int strip_height, CertificateImages which,
                                                       const RunContext& context);

// Certifies a tile set again; sets its certificate and heat. Colours that the set's recipe moved are moved on
// a copy of `material`, the one that was given to SynthesizeTileSet. Errors: FAILED_PRECONDITION when the set
// does not know where its BTFels lie in the exemplar, or `material` is not the one it was made of (naming the
// first BTFel that differs); those of CertifyTiles, of Codec::Embed and of FindArrangement.
[[nodiscard]] absl::Status CertifyTileSet(const Material& material, CertificateImages which,
                                          const RunContext& context, TileSet& tile_set);

}  // namespace tessera
