#include "btf/tiles/certificate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <utility>

#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"
#include "btf/tiles/tile_sides.h"

namespace tessera {
namespace {

constexpr int kRunLength = 8;
constexpr double kEpsilonShare = 0.01;  // of the mean exemplar gradient
constexpr double kPercentile = 0.95;
constexpr int kTexelsPerBlock = 256;
// Recorded angles are rounded, since 15 degrees do not survive radians.
constexpr double kAnglesPerDegree = 1e6;

double RecordedDeg(double rad) {
  return std::round(DegFromRad(rad) * kAnglesPerDegree) / kAnglesPerDegree;
}

float Difference(const ExemplarImage& image, uint32_t a, uint32_t b) {
  const float* const p = image.rgb[TurnsOfTexel(a)].data() + size_t{3} * BtfelOfTexel(a);
  const float* const q = image.rgb[TurnsOfTexel(b)].data() + size_t{3} * BtfelOfTexel(b);
  return std::sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                   (p[2] - q[2]) * (p[2] - q[2]));
}

// The nearest-rank percentile; 1 for none.
double Percentile95(std::vector<double> values) {
  if (values.empty()) {
    return 1.0;
  }
  const auto rank =
      static_cast<std::ptrdiff_t>(std::ceil(kPercentile * static_cast<double>(values.size()))) - 1;
  std::nth_element(values.begin(), values.begin() + rank, values.end());
  return values[rank];
}

}  // namespace

CertificateBuilder::CertificateBuilder(const Exemplar& exemplar, const Arrangement& arrangement,
                                       const IndexMaps& maps)
    : exemplar_(&exemplar) {
  CollectInsides(maps);
  CollectBorders(arrangement, maps);
  for (Part* const part : {&borders_, &insides_}) {
    part->by_run.resize(part->num_runs);
    for (const CutPair& pair : part->pairs) {
      part->num_cut += pair.weight;
    }
  }
}

// Numbers the full runs among the pairs from `first_pair` on.
void CertificateBuilder::AssignRun(Part& part, size_t first_pair) {
  const size_t num_full = (part.pairs.size() - first_pair) / kRunLength * kRunLength;
  for (size_t i = 0; i < num_full; ++i) {
    part.pairs[first_pair + i].run = part.num_runs + static_cast<int>(i / kRunLength);
  }
  part.num_runs += static_cast<int>(num_full / kRunLength);
}

void CertificateBuilder::CollectInsides(const IndexMaps& maps) {
  const int size = maps.tile_size;
  const int num_tiles = static_cast<int>(maps.texels.size() / (static_cast<size_t>(size) * size));
  for (int tile = 0; tile < num_tiles; ++tile) {
    // Pairs side by side are walked down their columns, pairs one above the other along their rows: along the
    // seam.
    for (const bool down : {false, true}) {
      const int direction = down ? GridCut::kDown : GridCut::kRight;
      const size_t first_pair = insides_.pairs.size();
      for (int line = 0; line + 1 < size; ++line) {
        for (int i = 0; i < size; ++i) {
          const uint32_t a = down ? maps.texel(tile, i, line) : maps.texel(tile, line, i);
          const uint32_t b = down ? maps.texel(tile, i, line + 1) : maps.texel(tile, line + 1, i);
          insides_.num_pairs += 1.0;
          if (exemplar_->Step(a, direction) != b) {
            insides_.pairs.push_back({a, b, direction});
          }
        }
      }
      AssignRun(insides_, first_pair);
      for (int line = 0; line < size; ++line) {
        int run = 1;
        for (int i = 1; i <= size; ++i) {
          insides_.longest_run = std::max(insides_.longest_run, run);
          if (i == size) {
            break;
          }
          const uint32_t a = down ? maps.texel(tile, line, i - 1) : maps.texel(tile, i - 1, line);
          const uint32_t b = down ? maps.texel(tile, line, i) : maps.texel(tile, i, line);
          run = exemplar_->Step(a, direction) == b ? run + 1 : 1;
        }
      }
    }
  }
}

void CertificateBuilder::CollectBorders(const Arrangement& arrangement, const IndexMaps& maps) {
  const int size = maps.tile_size;
  // All '+' and all '-' sides by strip, as (tile, side). A '+' side shows the strip turned by `side`, a '-'
  // side by side + 2; turned back, the '+' tile lies above the '-' tile.
  for (int strip = 0; strip < NumStrips(arrangement); ++strip) {
    std::array<std::vector<std::pair<int, int>>, 2> sides_by_sign;
    for (int tile = 0; tile < static_cast<int>(arrangement.codes.size()); ++tile) {
      const TileSides sides = SidesFromTileCode(arrangement.codes[tile]);
      for (int side = 0; side < 4; ++side) {
        if (StripOfSide(arrangement, side, sides[side].colour) == strip) {
          sides_by_sign[sides[side].sign == Sign::kPlus ? 0 : 1].emplace_back(tile, side);
        }
      }
    }
    const auto& [plus, minus] = sides_by_sign;
    if (plus.empty() || minus.empty()) {
      continue;
    }
    const auto border_texel = [&](const std::pair<int, int>& at, Sign sign, int x) {
      const int along = sign == Sign::kPlus ? x : size - 1 - x;
      const auto [column, row] = TilePixelAt(at.second, along, 0, size);
      const int shown = sign == Sign::kPlus ? at.second : at.second + 2;
      return TurnTexel(maps.texel(at.first, column, row), 4 - (shown & 3));
    };
    const double weight = static_cast<double>(plus.size()) * static_cast<double>(minus.size());
    const size_t first_pair = borders_.pairs.size();
    int run = 0;
    uint32_t previous_a = kNoTexel;
    for (int x = 1; x + 1 < size; ++x) {
      const uint32_t a = border_texel(plus.front(), Sign::kPlus, x);
      const uint32_t b = border_texel(minus.front(), Sign::kMinus, x);
      borders_.num_pairs += weight;
      const bool cut = exemplar_->Step(a, GridCut::kDown) != b;
      if (cut) {
        borders_.pairs.push_back({a, b, GridCut::kDown, weight});
      }
      run = cut ? 0 : run > 0 && exemplar_->Step(previous_a, GridCut::kRight) == a ? run + 1 : 1;
      borders_.longest_run = std::max(borders_.longest_run, run);
      previous_a = a;
    }
    AssignRun(borders_, first_pair);
    // The texels at both ends depend on the tiles: all pairs, equal ones together.
    std::map<std::pair<uint32_t, uint32_t>, double> ends;
    for (const auto& above : plus) {
      for (const auto& below : minus) {
        for (const int x : {0, size - 1}) {
          ends[{border_texel(above, Sign::kPlus, x), border_texel(below, Sign::kMinus, x)}] += 1.0;
        }
      }
    }
    for (const auto& [texels, count] : ends) {
      borders_.num_pairs += count;
      if (exemplar_->Step(texels.first, GridCut::kDown) != texels.second) {
        borders_.pairs.push_back({texels.first, texels.second, GridCut::kDown, count});
      }
    }
  }
}

void CertificateBuilder::Add(const ExemplarImage& image) {
  double gradient = 0.0;
  int64_t count = 0;
  const int turn = image.rgb[0].empty() ? 3 : 0;  // any turn of the exemplar has the same neighbours
  for (int pixel = 0; pixel < exemplar_->num_pixels(); ++pixel) {
    const uint32_t texel = PackTexel(static_cast<uint32_t>(pixel), turn);
    for (const int direction : {GridCut::kRight, GridCut::kDown}) {
      if (const uint32_t beside = exemplar_->Step(texel, direction); beside != kNoTexel) {
        gradient += Difference(image, texel, beside);
        ++count;
      }
    }
  }
  gradient /= static_cast<double>(std::max<int64_t>(1, count));
  const double epsilon = kEpsilonShare * gradient;
  for (Part* const part : {&borders_, &insides_}) {
    Sums total;
    for (const CutPair& pair : part->pairs) {
      const uint32_t a_at_q = exemplar_->Step(pair.a, pair.direction);
      const uint32_t b_at_p = exemplar_->Step(pair.b, pair.direction ^ 2);
      double natural = 0.0;
      int known = 0;
      if (a_at_q != kNoTexel) {
        natural += Difference(image, pair.a, a_at_q);
        ++known;
      }
      if (b_at_p != kNoTexel) {
        natural += Difference(image, b_at_p, pair.b);
        ++known;
      }
      natural = known > 0 ? natural / known : gradient;
      const double step = Difference(image, pair.a, pair.b);
      total.step += pair.weight * step;
      total.natural += pair.weight * (natural + epsilon);
      if (pair.run >= 0) {
        part->by_run[pair.run].step += step;
        part->by_run[pair.run].natural += natural + epsilon;
      }
    }
    part->by_image.push_back(total);
  }
  images_.push_back({{"view_polar_deg", RecordedDeg(image.view.theta_rad)},
                     {"view_azimuth_deg", RecordedDeg(image.view.phi_rad)},
                     {"light_polar_deg", RecordedDeg(image.light.theta_rad)},
                     {"light_azimuth_deg", RecordedDeg(image.light.phi_rad)}});
}

nlohmann::json CertificateBuilder::Describe(const Part& part) {
  const auto ratio = [](const Sums& sums) { return sums.natural > 0.0 ? sums.step / sums.natural : 1.0; };
  Sums pooled;
  double worst = part.pairs.empty() ? 1.0 : 0.0;
  std::vector<double> by_image;
  for (const Sums& sums : part.by_image) {
    pooled.step += sums.step;
    pooled.natural += sums.natural;
    by_image.push_back(ratio(sums));
    worst = std::max(worst, by_image.back());
  }
  std::vector<double> by_run;
  for (const Sums& sums : part.by_run) {
    by_run.push_back(ratio(sums));
  }
  const double cut_share = part.num_pairs > 0.0 ? part.num_cut / part.num_pairs : 0.0;
  return {{"ratio", ratio(pooled)},
          {"ratio_p95", Percentile95(std::move(by_image))},
          {"ratio_worst", worst},
          {"ratio_run_p95", Percentile95(std::move(by_run))},
          {"cut_share", cut_share},
          {"verbatim_share", 1.0 - cut_share},
          {"longest_verbatim_run", part.longest_run}};
}

nlohmann::json CertificateBuilder::Finish() const {
  return {{"images", images_}, {"borders", Describe(borders_)}, {"insides", Describe(insides_)}};
}

absl::StatusOr<nlohmann::json> CertifyTiles(const Material& material, const Exemplar& exemplar,
                                            const Arrangement& arrangement, const IndexMaps& maps,
                                            const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(material.btfels));
  std::array<bool, 4> turn_occurs = {true, false, false, false};
  for (const uint32_t texel : maps.texels) {
    turn_occurs[TurnsOfTexel(texel)] = true;
  }
  // Border pairs are looked at in the strip's frame, where texels of vertical strips in plane-* have turn 3.
  turn_occurs[3] = true;
  std::vector<int> turns;
  for (int turn = 0; turn < 4; ++turn) {
    if (turn_occurs[turn]) {
      turns.push_back(turn);
    }
  }

  CertificateBuilder builder(exemplar, arrangement, maps);
  const size_t k = material.btfels.num_coefficients;
  const int num_lights = static_cast<int>(kCertificateLights.size());
  for (const auto& view_deg : kCertificateViews) {
    const Direction view{RadFromDeg(view_deg[0]), RadFromDeg(view_deg[1])};
    std::vector<ExemplarImage> images(num_lights);
    for (int light = 0; light < num_lights; ++light) {
      images[light].view = view;
      images[light].light = {RadFromDeg(kCertificateLights[light][0]),
                             RadFromDeg(kCertificateLights[light][1])};
      for (const int turn : turns) {
        images[light].rgb[turn].resize(size_t{3} * exemplar.num_pixels());
      }
    }
    ParallelFor(context, 0, exemplar.num_pixels(), kTexelsPerBlock, [&](int64_t begin, int64_t end) {
      const auto count = static_cast<size_t>(end - begin);
      const std::span<const uint8_t> codes = std::span(material.btfels.codes).subspan(begin * k, count * k);
      for (ExemplarImage& image : images) {
        for (const int turn : turns) {
          decoder->DecodeTexels(codes, VectorFromDirection(image.light), VectorFromDirection(view), turn,
                                std::span(image.rgb[turn]).subspan(3 * begin, 3 * count));
        }
      }
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    for (const ExemplarImage& image : images) {
      builder.Add(image);
    }
  }
  return builder.Finish();
}

}  // namespace tessera
