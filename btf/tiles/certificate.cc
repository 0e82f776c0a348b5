#include "btf/tiles/certificate.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/math/conventions.h"
#include "btf/tiles/features.h"
#include "btf/tiles/repetition.h"
#include "btf/tiles/seam_controls.h"
#include "btf/tiles/tile_sides.h"

namespace tessera {
namespace {

constexpr double kEpsilonShare = 0.01;  // of the mean exemplar gradient
constexpr double kPercentile = 0.95;
constexpr int kStrata = 16;  // of views and of lights
static_assert(kStrata * kStrata == kCertificateImages);
constexpr int kImagesAtOnce = 8;
constexpr int kTexelsPerBlock = 256;
constexpr int kPairsPerBlock = 1024;

float Difference(const ExemplarImage& image, uint32_t a, uint32_t b) {
  const float* const p = image.rgb[TurnsOfTexel(a)].data() + size_t{3} * BtfelOfTexel(a);
  const float* const q = image.rgb[TurnsOfTexel(b)].data() + size_t{3} * BtfelOfTexel(b);
  return std::sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                   (p[2] - q[2]) * (p[2] - q[2]));
}

// The mean distance of neighbours in an image of the exemplar.
double MeanGradient(const Exemplar& exemplar, const ExemplarImage& image) {
  double gradient = 0.0;
  int64_t count = 0;
  const int turn = image.rgb[0].empty() ? 3 : 0;  // any turn of the exemplar has the same neighbours
  for (int pixel = 0; pixel < exemplar.num_pixels(); ++pixel) {
    const uint32_t texel = PackTexel(static_cast<uint32_t>(pixel), turn);
    for (const int direction : {GridCut::kRight, GridCut::kDown}) {
      if (const uint32_t beside = exemplar.Step(texel, direction); beside != kNoTexel) {
        gradient += Difference(image, texel, beside);
        ++count;
      }
    }
  }
  return gradient / static_cast<double>(std::max<int64_t>(1, count));
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

// Notes the full runs among the pairs from `first_pair` on.
void AddRuns(Seams& seams, size_t first_pair) {
  for (size_t start = first_pair; start + kSeamRun <= seams.pairs.size(); start += kSeamRun) {
    seams.run_starts.push_back(start);
  }
}

// Element `i` of `count` equal parts of 0..extent-1.
int DrawFromPart(int i, int count, int extent, uint64_t draw) {
  const int begin = static_cast<int>(int64_t{i} * extent / count);
  const int end = static_cast<int>(int64_t{i + 1} * extent / count);
  return begin + static_cast<int>(draw % static_cast<uint64_t>(end - begin));
}

double ReferencedShare(const Exemplar& exemplar, const IndexMaps& maps) {
  std::vector<bool> referenced(exemplar.num_pixels(), false);
  for (const uint32_t texel : maps.texels) {
    referenced[BtfelOfTexel(texel)] = true;
  }
  return static_cast<double>(std::ranges::count(referenced, true)) / exemplar.num_pixels();
}

}  // namespace

std::vector<uint8_t> HeatOf(std::span<const SeamMeter* const> meters, size_t num_texels) {
  std::vector<SeamMeter::Sums> sums(num_texels);
  for (const SeamMeter* const meter : meters) {
    for (const auto& [pair, texel] : meter->seams().places) {
      sums[texel].step += meter->of_pair(pair).step;
      sums[texel].natural += meter->of_pair(pair).natural;
    }
  }
  std::vector<uint8_t> heat(num_texels, 0);
  for (size_t i = 0; i < num_texels; ++i) {
    if (sums[i].natural > 0.0) {
      heat[i] = static_cast<uint8_t>(std::clamp(std::round(kHeatOfOne * sums[i].ratio()), 1.0, 255.0));
    }
  }
  return heat;
}

void DecodeExemplarImages(const Decoder& decoder, const BtfelTable& table, std::span<const ImagePair> pairs,
                          const RunContext& context, std::span<ExemplarImage> images) {
  const size_t k = table.num_coefficients;
  ParallelFor(context, 0, static_cast<int64_t>(table.size()), kTexelsPerBlock,
              [&](int64_t begin, int64_t end) {
                const auto count = static_cast<size_t>(end - begin);
                const std::span<const uint8_t> codes = std::span(table.codes).subspan(begin * k, count * k);
                for (size_t i = 0; i < images.size(); ++i) {
                  const Eigen::Vector3d light = VectorFromDirection(table.lights[pairs[i].light]);
                  const Eigen::Vector3d view = VectorFromDirection(table.views[pairs[i].view]);
                  for (int turn = 0; turn < 4; ++turn) {
                    if (!images[i].rgb[turn].empty()) {
                      decoder.DecodeTexels(codes, light, view, turn,
                                           std::span(images[i].rgb[turn]).subspan(3 * begin, 3 * count));
                    }
                  }
                }
              });
}

std::vector<ImagePair> ChooseImages(int num_views, int num_lights, CertificateImages which) {
  std::vector<ImagePair> images;
  int view_parts = num_views;
  int light_parts = num_lights;
  if (which == CertificateImages::kStratified && int64_t{num_views} * num_lights > kCertificateImages) {
    const auto parts_beside = [](int others) { return (kCertificateImages + others - 1) / others; };
    light_parts = std::min(num_lights, parts_beside(std::min(kStrata, num_views)));
    view_parts = std::min(num_views, parts_beside(light_parts));
  }
  for (int i = 0; i < view_parts; ++i) {
    for (int j = 0; j < light_parts; ++j) {
      const uint64_t draw = Mix64(static_cast<uint64_t>(i), static_cast<uint64_t>(j));
      images.push_back({DrawFromPart(i, view_parts, num_views, draw >> 32),
                        DrawFromPart(j, light_parts, num_lights, draw & 0xffffffffu)});
    }
  }
  return images;
}

Seams InsideSeams(const Exemplar& exemplar, const IndexMaps& maps) {
  Seams seams;
  const int size = maps.tile_size;
  const auto area = static_cast<size_t>(size) * size;
  const int num_tiles = static_cast<int>(maps.texels.size() / area);
  for (int tile = 0; tile < num_tiles; ++tile) {
    // Pairs side by side are walked down their columns, pairs one above the other along their rows: along the
    // seam.
    for (const bool down : {false, true}) {
      const int direction = down ? GridCut::kDown : GridCut::kRight;
      const size_t first_pair = seams.pairs.size();
      // Texel i of line `line`.
      const auto index = [&](int line, int i) {
        return tile * area +
               (down ? static_cast<size_t>(line) * size + i : static_cast<size_t>(i) * size + line);
      };
      for (int line = 0; line + 1 < size; ++line) {
        for (int i = 0; i < size; ++i) {
          const uint32_t a = maps.texels[index(line, i)];
          const uint32_t b = maps.texels[index(line + 1, i)];
          seams.num_pairs += 1.0;
          if (exemplar.Step(a, direction) != b) {
            const auto pair = static_cast<uint32_t>(seams.pairs.size());
            seams.places.emplace_back(pair, index(line, i));
            seams.places.emplace_back(pair, index(line + 1, i));
            seams.pairs.push_back({a, b, direction});
          }
        }
      }
      AddRuns(seams, first_pair);
      for (int i = 0; i < size; ++i) {
        int run = 1;
        for (int line = 1; line <= size; ++line) {
          seams.longest_run = std::max(seams.longest_run, run);
          if (line == size) {
            break;
          }
          const bool goes_on =
              exemplar.Step(maps.texels[index(line - 1, i)], direction) == maps.texels[index(line, i)];
          run = goes_on ? run + 1 : 1;
        }
      }
    }
  }
  return seams;
}

Seams BorderSeams(const Exemplar& exemplar, const Arrangement& arrangement, const IndexMaps& maps) {
  Seams seams;
  const int size = maps.tile_size;
  // All '+' and all '-' sides by strip, as (tile, side). A '+' side shows the strip turned by `side`, a '-'
  // side by side + 2; turned back, the '+' tile lies above the '-' tile.
  using Side = std::pair<int, int>;
  for (int strip = 0; strip < NumStrips(arrangement); ++strip) {
    std::array<std::vector<Side>, 2> sides_by_sign;
    for (int tile = 0; tile < static_cast<int>(arrangement.codes.size()); ++tile) {
      const TileSides sides = arrangement.SidesOf(tile);
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
    const auto index = [&](const Side& at, Sign sign, int x) {
      const int along = sign == Sign::kPlus ? x : size - 1 - x;
      const auto [column, row] = TilePixelAt(at.second, along, 0, size);
      return (static_cast<size_t>(at.first) * size + row) * size + column;
    };
    const auto border_texel = [&](const Side& at, Sign sign, int x) {
      const int shown = sign == Sign::kPlus ? at.second : at.second + 2;
      return TurnTexel(maps.texels[index(at, sign, x)], 4 - (shown & 3));
    };
    const auto add_place = [&](const Side& at, Sign sign, int x) {
      seams.places.emplace_back(seams.pairs.size(), index(at, sign, x));
    };
    const double weight = static_cast<double>(plus.size()) * static_cast<double>(minus.size());
    const size_t first_pair = seams.pairs.size();
    int run = 0;
    uint32_t previous_a = kNoTexel;
    for (int x = 1; x + 1 < size; ++x) {
      const uint32_t a = border_texel(plus.front(), Sign::kPlus, x);
      const uint32_t b = border_texel(minus.front(), Sign::kMinus, x);
      seams.num_pairs += weight;
      const bool cut = exemplar.Step(a, GridCut::kDown) != b;
      if (cut) {
        for (const Side& at : plus) {
          add_place(at, Sign::kPlus, x);
        }
        for (const Side& at : minus) {
          add_place(at, Sign::kMinus, x);
        }
        seams.pairs.push_back({a, b, GridCut::kDown, weight});
      }
      run = cut ? 0 : run > 0 && exemplar.Step(previous_a, GridCut::kRight) == a ? run + 1 : 1;
      seams.longest_run = std::max(seams.longest_run, run);
      previous_a = a;
    }
    AddRuns(seams, first_pair);
    // The texels at both ends depend on the tiles: all pairs, equal ones together.
    std::map<std::pair<uint32_t, uint32_t>, double> ends;
    for (const Side& above : plus) {
      for (const Side& below : minus) {
        for (const int x : {0, size - 1}) {
          ends[{border_texel(above, Sign::kPlus, x), border_texel(below, Sign::kMinus, x)}] += 1.0;
        }
      }
    }
    for (const auto& [texels, count] : ends) {
      seams.num_pairs += count;
      if (exemplar.Step(texels.first, GridCut::kDown) != texels.second) {
        seams.pairs.push_back({texels.first, texels.second, GridCut::kDown, count});
      }
    }
  }
  return seams;
}

SeamMeter::SeamMeter(const Exemplar& exemplar, Seams seams)
    : exemplar_(&exemplar), seams_(std::move(seams)), by_pair_(seams_.pairs.size()) {}

void SeamMeter::Add(std::span<const ExemplarImage> images, const RunContext& context) {
  std::vector<double> gradients(images.size());
  ParallelFor(context, 0, static_cast<int64_t>(images.size()), 1,
              [&](int64_t i, int64_t) { gradients[i] = MeanGradient(*exemplar_, images[i]); });
  const auto num_pairs = static_cast<int64_t>(seams_.pairs.size());
  const int64_t num_blocks = (num_pairs + kPairsPerBlock - 1) / kPairsPerBlock;
  std::vector<Sums> by_block(num_blocks * images.size());
  ParallelFor(context, 0, num_pairs, kPairsPerBlock, [&](int64_t begin, int64_t end) {
    for (int64_t at = begin; at < end; ++at) {
      const CutPair& pair = seams_.pairs[at];
      const uint32_t a_at_q = exemplar_->Step(pair.a, pair.direction);
      const uint32_t b_at_p = exemplar_->Step(pair.b, pair.direction ^ 2);
      for (size_t i = 0; i < images.size(); ++i) {
        const ExemplarImage& image = images[i];
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
        natural = known > 0 ? natural / known : gradients[i];
        const double epsilon = kEpsilonShare * gradients[i];
        const double step = Difference(image, pair.a, pair.b) + epsilon;
        by_pair_[at].step += step;
        by_pair_[at].natural += natural + epsilon;
        Sums& sums = by_block[begin / kPairsPerBlock * images.size() + i];
        sums.step += pair.weight * step;
        sums.natural += pair.weight * (natural + epsilon);
      }
    }
  });
  for (size_t i = 0; i < images.size(); ++i) {
    Sums sums;
    for (int64_t block = 0; block < num_blocks; ++block) {
      sums.step += by_block[block * images.size() + i].step;
      sums.natural += by_block[block * images.size() + i].natural;
    }
    by_image_.push_back(sums);
  }
}

double SeamMeter::Ratio() const {
  Sums pooled;
  for (const Sums& sums : by_image_) {
    pooled.step += sums.step;
    pooled.natural += sums.natural;
  }
  return pooled.ratio();
}

nlohmann::json SeamMeter::Describe() const {
  double worst = seams_.pairs.empty() ? 1.0 : 0.0;
  std::vector<double> by_image;
  for (const Sums& sums : by_image_) {
    by_image.push_back(sums.ratio());
    worst = std::max(worst, by_image.back());
  }
  std::vector<double> by_run;
  for (const size_t start : seams_.run_starts) {
    Sums run;
    for (size_t pair = start; pair < start + kSeamRun; ++pair) {
      run.step += by_pair_[pair].step;
      run.natural += by_pair_[pair].natural;
    }
    by_run.push_back(run.ratio());
  }
  double num_cut = 0.0;
  for (const CutPair& pair : seams_.pairs) {
    num_cut += pair.weight;
  }
  const double cut_share = seams_.num_pairs > 0.0 ? num_cut / seams_.num_pairs : 0.0;
  return {{"ratio", Ratio()},
          {"ratio_p95", Percentile95(std::move(by_image))},
          {"ratio_worst", worst},
          {"ratio_run_p95", Percentile95(std::move(by_run))},
          {"cut_share", cut_share},
          {"verbatim_share", 1.0 - cut_share},
          {"longest_verbatim_run", seams_.longest_run}};
}

absl::StatusOr<Certificate> CertifyTiles(const Material& material, const Exemplar& exemplar,
                                         const Arrangement& arrangement, const IndexMaps& maps,
                                         int strip_height, CertificateImages which,
                                         const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(material.btfels));
  std::array<bool, 4> turn_occurs = {true, false, false, false};
  for (const uint32_t texel : maps.texels) {
    turn_occurs[TurnsOfTexel(texel)] = true;
  }
  // Border pairs are looked at in the strip's frame, where texels of vertical strips in plane-* have turn 3.
  turn_occurs[3] = true;
  const std::vector<int> control_turns = TurnsOfInterior(arrangement);
  for (const int turn : control_turns) {
    turn_occurs[turn] = true;
  }
  RandomJoins joins = JoinAtRandom(exemplar, control_turns, strip_height);
  // In the order of `figures` below.
  std::vector<SeamMeter> meters;
  meters.emplace_back(exemplar, BorderSeams(exemplar, arrangement, maps));
  meters.emplace_back(exemplar, InsideSeams(exemplar, maps));
  meters.emplace_back(exemplar, FalseCuts(exemplar, strip_height));
  meters.emplace_back(exemplar, std::move(joins.minimum_cuts));
  meters.emplace_back(exemplar, std::move(joins.straight_cuts));

  const BtfelTable& table = material.btfels;
  const std::vector<ImagePair> pairs =
      ChooseImages(static_cast<int>(table.views.size()), static_cast<int>(table.lights.size()), which);
  std::vector<ExemplarImage> images(std::min<size_t>(kImagesAtOnce, pairs.size()));
  for (ExemplarImage& image : images) {
    for (int turn = 0; turn < 4; ++turn) {
      image.rgb[turn].resize(turn_occurs[turn] ? size_t{3} * exemplar.num_pixels() : 0);
    }
  }
  for (size_t first = 0; first < pairs.size(); first += images.size()) {
    context.Report("certificate", static_cast<int64_t>(first), static_cast<int64_t>(pairs.size()), "images");
    images.resize(std::min(images.size(), pairs.size() - first));
    DecodeExemplarImages(*decoder, table, std::span(pairs).subspan(first, images.size()), context, images);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    for (SeamMeter& meter : meters) {
      meter.Add(images, context);
    }
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  TESSERA_ASSIGN_OR_RETURN(nlohmann::json repetition,
                           MeasureRepetition(exemplar, arrangement, maps, strip_height, context));
  context.Report("certificate", static_cast<int64_t>(pairs.size()), static_cast<int64_t>(pairs.size()),
                 "images");

  Certificate certificate;
  certificate.figures = {{"images",
                          {{"count", pairs.size()},
                           {"of", table.views.size() * table.lights.size()},
                           {"rule", which == CertificateImages::kAll ? "all" : "stratified"}}},
                         {"referenced_share", ReferencedShare(exemplar, maps)},
                         {"borders", meters[0].Describe()},
                         {"insides", meters[1].Describe()},
                         {"controls",
                          {{"false_cuts", meters[2].Ratio()},
                           {"random_minimum_cuts", meters[3].Ratio()},
                           {"random_straight_cuts", meters[4].Ratio()}}},
                         {"repetition", std::move(repetition)}};
  certificate.heat = HeatOf(std::array<const SeamMeter*, 2>{&meters[0], &meters[1]}, maps.texels.size());
  return certificate;
}

absl::Status CertifyTileSet(const Material& original, CertificateImages which, const RunContext& context,
                            TileSet& tile_set) {
  TESSERA_ASSIGN_OR_RETURN(const std::optional<Material> recoloured,
                           RecolouredAs(tile_set.metadata, original, context));
  const Material& material = recoloured ? *recoloured : original;
  const BtfelTable& own = tile_set.btfels;
  const BtfelTable& exemplar_table = material.btfels;
  const std::optional<SourceGrid> grid = SourceGridOf(tile_set);
  if (tile_set.source_pixels.empty() || (grid.has_value() && grid->footprint != 1)) {
    return absl::FailedPreconditionError(
        "the tile set does not record where its BTFels lie in the exemplar: synthesise it again");
  }
  if (own.codec_id != exemplar_table.codec_id || own.num_coefficients != exemplar_table.num_coefficients ||
      own.offset != exemplar_table.offset || own.step != exemplar_table.step) {
    return absl::FailedPreconditionError("the material is not the one that the tile set was made of");
  }
  for (size_t i = 0; i < own.size(); ++i) {
    const uint32_t pixel = tile_set.source_pixels[i];
    if (pixel >= exemplar_table.size() || !std::ranges::equal(own.btfel(i), exemplar_table.btfel(pixel))) {
      return absl::FailedPreconditionError(
          absl::StrFormat("the material is not the one that the tile set was made of: BTFel %d is not its "
                          "texel %d",
                          i, pixel));
    }
  }
  const Codec* const codec = FindCodec(own.codec_id);
  if (codec == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat("unknown codec '", own.codec_id, "'"));
  }
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* const arrangement, FindArrangement(tile_set.arrangement_id));
  IndexMaps maps{.tile_size = tile_set.tile_size};
  maps.texels.reserve(tile_set.tile_index.size());
  for (const uint32_t texel : tile_set.tile_index) {
    maps.texels.push_back(PackTexel(tile_set.source_pixels[BtfelOfTexel(texel)], TurnsOfTexel(texel)));
  }
  TESSERA_ASSIGN_OR_RETURN(const Embedding embedding, codec->Embed(material, kCutDims, context));
  TESSERA_ASSIGN_OR_RETURN(
      Certificate certificate,
      CertifyTiles(material, Exemplar(embedding), *arrangement, maps, tile_set.strip_height, which, context));
  tile_set.certificate = std::move(certificate.figures);
  tile_set.seam_heat = std::move(certificate.heat);
  return absl::OkStatus();
}

}  // namespace tessera
