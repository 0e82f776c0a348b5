// The certificate of a tile set: how visible its seams are, in reflectance, against the material's own
// changes from texel to texel.
//
// A pair of 4-neighbours (p, q) of the output is cut when their sources a, b do not continue each other. a'
// is where q would lie in p's patch, b' where p would lie in q's. In image i (one view and light), with |.|
// the Euclidean distance of RGB and every texel seen in its own turn,
//
//   s = |x_i(a) - x_i(b)|,  n = (|x_i(a) - x_i(a')| + |x_i(b') - x_i(b)|) / 2,  R = sum s / sum (n + eps),
//
// eps = 1% of the mean distance of neighbours in image i of the exemplar. Where a' or b' falls off the
// exemplar, n is the other one's; where both do, it is that mean distance. Borders are the pairs across the
// common side of two tiles, over all legal pairs of tiles and turns; insides are all pairs within a tile.
#pragma once

#include <span>
#include <vector>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"
#include "btf/math/conventions.h"
#include "btf/tiles/index_maps.h"

namespace tessera {

// One view and light of the exemplar: RGB by [turn][pixel], turns that do not occur may be empty.
struct ExemplarImage {
  Direction view;
  Direction light;
  std::array<std::vector<float>, 4> rgb;
};

// Collects the sums of R over images given one by one, so that memory holds few of them.
class CertificateBuilder {
 public:
  CertificateBuilder(const Exemplar& exemplar, const Arrangement& arrangement, const IndexMaps& maps);

  void Add(const ExemplarImage& image);

  // Keys: images [{view_polar_deg, view_azimuth_deg, light_polar_deg, light_azimuth_deg}], and `borders` and
  // `insides`, each with ratio (R pooled over images), ratio_p95 and ratio_worst (over images), ratio_run_p95
  // (over runs of 8 cut pairs that follow each other along one border, or down and across one tile; R pooled
  // over images), cut_share (of pairs), verbatim_share (1 - cut_share) and longest_verbatim_run (texels in a
  // row or column; along the border for borders). All ratios are 1 where nothing is cut.
  [[nodiscard]] nlohmann::json Finish() const;

 private:
  // A cut pair, q in `direction` from p.
  struct CutPair {
    uint32_t a = 0;
    uint32_t b = 0;
    int direction = 0;
    double weight = 1.0;
    int run = -1;  // -1: in none
  };
  struct Sums {
    double step = 0.0;     // sum of weight s
    double natural = 0.0;  // sum of weight (n + eps)
  };
  struct Part {
    std::vector<CutPair> pairs;
    double num_pairs = 0.0;  // weighted, cut or not
    double num_cut = 0.0;
    int longest_run = 0;
    int num_runs = 0;
    std::vector<Sums> by_image;
    std::vector<Sums> by_run;
  };

  void CollectInsides(const IndexMaps& maps);
  void CollectBorders(const Arrangement& arrangement, const IndexMaps& maps);
  static void AssignRun(Part& part, size_t first_pair);
  static nlohmann::json Describe(const Part& part);

  const Exemplar* exemplar_;
  Part borders_;
  Part insides_;
  nlohmann::json images_ = nlohmann::json::array();
};

// The certificate over kCertificateViews x kCertificateLights, decoded from the material.
// Errors: INVALID_ARGUMENT or UNIMPLEMENTED from the decoder, CANCELLED.
absl::StatusOr<nlohmann::json> CertifyTiles(const Material& material, const Exemplar& exemplar,
                                            const Arrangement& arrangement, const IndexMaps& maps,
                                            const RunContext& context);

// Polar and azimuth in degrees.
inline constexpr std::array<std::array<double, 2>, 4> kCertificateViews = {
    {{0.0, 0.0}, {45.0, 30.0}, {45.0, 150.0}, {45.0, 270.0}}};
inline constexpr std::array<std::array<double, 2>, 4> kCertificateLights = {
    {{15.0, 0.0}, {45.0, 90.0}, {45.0, 210.0}, {60.0, 330.0}}};

}  // namespace tessera
