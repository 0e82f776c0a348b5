#include "btf/tiles/synthesize.h"

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "btf/base/reason.h"
#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/tiles/anisotropy.h"
#include "btf/tiles/certificate.h"
#include "btf/tiles/features.h"
#include "btf/tiles/index_maps.h"
#include "btf/tiles/pattern.h"
#include "btf/tiles/seam_embedding.h"

namespace tessera {
namespace {

// What the embedding that seams are laid in holds.
nlohmann::json DescribeCaptured(const Embedding& embedding) {
  const auto share = [&](int dims) {
    double captured = 0.0;
    for (int dim = 0; dim < std::min<int>(dims, static_cast<int>(embedding.variance.size())); ++dim) {
      captured += embedding.variance[dim];
    }
    return embedding.total_variance > 0.0 ? captured / embedding.total_variance : 1.0;
  };
  return {{"search_dims", std::min(embedding.dims, kSearchDims)},
          {"search_share", share(kSearchDims)},
          {"cut_dims", std::min(embedding.dims, kCutDims)},
          {"cut_share", share(kCutDims)}};
}

// The table of the BTFels that occur, in ascending exemplar order, and the index of each.
struct Referenced {
  BtfelTable table;
  std::vector<uint32_t> pixels;          // of each BTFel of the table
  std::vector<uint32_t> index_of_pixel;  // kNoTexel where unused
};

Referenced KeepReferenced(const BtfelTable& exemplar, const std::vector<uint32_t>& texels) {
  Referenced referenced;
  referenced.index_of_pixel.assign(exemplar.size(), kNoTexel);
  for (const uint32_t texel : texels) {
    referenced.index_of_pixel[BtfelOfTexel(texel)] = 0;
  }
  BtfelTable& table = referenced.table;
  table.codec_id = exemplar.codec_id;
  table.codec_version = exemplar.codec_version;
  table.num_coefficients = exemplar.num_coefficients;
  table.offset = exemplar.offset;
  table.step = exemplar.step;
  table.tables = exemplar.tables;
  table.parameters = exemplar.parameters;
  table.views = exemplar.views;
  table.lights = exemplar.lights;
  for (size_t pixel = 0; pixel < referenced.index_of_pixel.size(); ++pixel) {
    if (referenced.index_of_pixel[pixel] != kNoTexel) {
      referenced.index_of_pixel[pixel] = static_cast<uint32_t>(referenced.pixels.size());
      referenced.pixels.push_back(static_cast<uint32_t>(pixel));
      const auto codes = exemplar.btfel(pixel);
      table.codes.insert(table.codes.end(), codes.begin(), codes.end());
    }
  }
  return referenced;
}

nlohmann::json DescribeReports(const IndexMaps& maps) {
  const auto summary = [](const std::vector<const FillReport*>& reports) {
    double mean = 0.0;
    double worst_mean = 0.0;
    double largest = 0.0;
    int64_t truncated = 0;
    int64_t patches = 0;
    int64_t kept = 0;
    for (const FillReport* const report : reports) {
      mean += report->mean_mismatch / static_cast<double>(reports.size());
      worst_mean = std::max(worst_mean, report->mean_mismatch);
      largest = std::max(largest, report->largest_mismatch);
      truncated += report->num_truncated;
      patches += report->num_patches;
      kept += report->num_kept;
    }
    return nlohmann::json{{"mean_mismatch", mean},       {"worst_mean_mismatch", worst_mean},
                          {"largest_mismatch", largest}, {"truncated_pairs", truncated},
                          {"patches_tried", patches},    {"patches_kept", kept}};
  };
  std::vector<const FillReport*> strips;
  std::vector<const FillReport*> tiles;
  for (const Strip& strip : maps.strips) {
    strips.push_back(&strip.report);
  }
  for (const FillReport& report : maps.tile_reports) {
    tiles.push_back(&report);
  }
  std::vector<const FillReport*> all = strips;
  all.insert(all.end(), tiles.begin(), tiles.end());
  const bool reached =
      std::all_of(all.begin(), all.end(), [](const FillReport* report) { return report->reached; });
  return {{"strips", summary(strips)}, {"tiles", summary(tiles)}, {"thresholds_reached", reached}};
}

// What CheckSizes can be asked before the sizes that are 0 have been chosen.
SynthesisParams SmallestSizes(SynthesisParams params) {
  params.strip_height = params.strip_height == 0 ? kSmallestStrip : params.strip_height;
  params.tile_size = params.tile_size == 0 ? 2 * params.strip_height : params.tile_size;
  return params;
}

SynthesisParams ChosenSizes(const Material& material, const Arrangement& arrangement,
                            const MaterialPattern& pattern, SynthesisParams params) {
  if (params.tile_size == 0) {
    params.tile_size = TileSizeFor(pattern, params.strip_height,
                                   !arrangement.turned_strips && params.method == SynthesisMethod::kFrame);
  }
  if (params.strip_height == 0) {
    params.strip_height = StripHeightFor(pattern, material.width, material.height, params.tile_size);
  }
  return params;
}

// "(7.1, 7.1) and (-7.1, 7.1)".
std::string PeriodText(const Period& period) {
  std::vector<std::string> vectors;
  for (const PeriodVector& vector : period.vectors) {
    vectors.push_back(absl::StrFormat("(%.1f, %.1f)", vector[0], vector[1]));
  }
  return absl::StrJoin(vectors, " and ");
}

// Why each size that was 0 was chosen.
std::vector<std::string> SizeNotes(const MaterialPattern& pattern, const SynthesisParams& asked,
                                   const SynthesisParams& chosen) {
  std::vector<std::string> notes;
  if (asked.tile_size == 0 && pattern.period &&
      PeriodSlip(*pattern.period, chosen.tile_size) <= LargestSlip(*pattern.period)) {
    notes.push_back(absl::StrFormat("tile %d: in step with the material's period of %s texels",
                                    chosen.tile_size, PeriodText(*pattern.period)));
  }
  if (asked.strip_height == 0) {
    const bool limited = chosen.strip_height < pattern.feature_size - 1.0;
    notes.push_back(
        absl::StrFormat("strip %d: features of %.1f texels%s", chosen.strip_height, pattern.feature_size,
                        limited ? "; at most half a tile and a tenth of the material's shorter side" : ""));
  }
  return notes;
}

// Why a regular material will not keep its period.
std::vector<std::string> PeriodWarnings(const Arrangement& arrangement, const MaterialPattern& pattern,
                                        const SynthesisParams& params) {
  if (!pattern.period) {
    return {};
  }
  const Period& period = *pattern.period;
  const std::string repeats = absl::StrFormat("the material repeats every %s texels", PeriodText(period));
  if (arrangement.turned_strips) {
    return {absl::StrFormat("%s: the turned strips of %s cannot be relied on to keep step; take plane-16",
                            repeats, arrangement.id)};
  }
  const double slip = PeriodSlip(period, params.tile_size);
  if (slip <= LargestSlip(period)) {
    return {};
  }
  const std::optional<int> in_step =
      TileSizeInStep(period, params.tile_size, 2 * kSmallestStrip, 4 * params.tile_size);
  return {absl::StrFormat("%s: tiles of %d are out of step by %.1f texels (limit %.1f)%s", repeats,
                          params.tile_size, slip, LargestSlip(period),
                          in_step ? absl::StrFormat("; %d is the nearest size in step", *in_step)
                                  : std::string("; no size near is in step"))};
}

}  // namespace

std::string_view SynthesisMethodName(SynthesisMethod method) {
  switch (method) {
    case SynthesisMethod::kDiamondDp:
      return "diamond-dp";
    case SynthesisMethod::kDiamondCut:
      return "diamond-cut";
    case SynthesisMethod::kFrame:
      break;
  }
  return "frame";
}

absl::StatusOr<SynthesisMethod> ParseSynthesisMethod(std::string_view name) {
  std::vector<std::string> known;
  for (const SynthesisMethod method : kSynthesisMethods) {
    if (name == SynthesisMethodName(method)) {
      return method;
    }
    known.emplace_back(SynthesisMethodName(method));
  }
  return absl::InvalidArgumentError(
      absl::StrFormat("unknown method \"%s\", known: %s", std::string(name), absl::StrJoin(known, ", ")));
}

TileSet TileSetOfMaps(const Material& material, const Arrangement& arrangement, const IndexMaps& maps,
                      const SynthesisParams& params) {
  TileSet set;
  set.arrangement_id = arrangement.id;
  set.arrangement_sha256 = arrangement.sha256;
  set.tile_size = params.tile_size;
  set.strip_height = params.strip_height;
  set.tile_codes = arrangement.codes;
  set.provenance = material.provenance;
  set.radiometry = material.radiometry;
  Referenced referenced = KeepReferenced(material.btfels, maps.texels);
  set.btfels = std::move(referenced.table);
  set.source_pixels = std::move(referenced.pixels);
  set.tile_index.reserve(maps.texels.size());
  for (const uint32_t texel : maps.texels) {
    set.tile_index.push_back(PackTexel(referenced.index_of_pixel[BtfelOfTexel(texel)], TurnsOfTexel(texel)));
  }
  return set;
}

namespace {

nlohmann::json DescribeFeatures(const std::vector<Feature>& features) {
  nlohmann::json described = nlohmann::json::array();
  for (const Feature& feature : features) {
    described.push_back({{"name", feature.name},
                         {"texels", feature.num_texels},
                         {"box", {feature.box.x, feature.box.y, feature.box.width, feature.box.height}}});
  }
  return described;
}

// The tile set of a material whose embedding and features are at hand.
absl::StatusOr<TileSet> SynthesizeEmbedded(const Material& material, const Embedding& embedding,
                                           const std::vector<Feature>& features,
                                           const Arrangement& arrangement, const SynthesisParams& asked,
                                           const RunContext& context) {
  const Exemplar exemplar(embedding);
  TESSERA_ASSIGN_OR_RETURN(const MaterialPattern pattern, MeasurePattern(exemplar, context));
  if (arrangement.turned_strips && pattern.anisotropy > kAnisotropyLimit && !asked.force) {
    return WithReason(
        absl::FailedPreconditionError(absl::StrFormat(
            "material is not isotropic: anisotropy %.2f (a turned patch is so many times as far from its "
            "nearest like as an unturned one), limit %.2f for '%s', whose strips are turned",
            pattern.anisotropy, kAnisotropyLimit, arrangement.id)),
        "NOT_ISOTROPIC");
  }
  const SynthesisParams params = ChosenSizes(material, arrangement, pattern, asked);

  Controls controls;
  if (params.recipe) {
    TESSERA_ASSIGN_OR_RETURN(controls, MakeControls(*params.recipe, features, exemplar, arrangement,
                                                    params.tile_size, params.strip_height));
  }
  TESSERA_ASSIGN_OR_RETURN(const Embedding laid_in, params.seam_rule == SeamRule::kExcess
                                                        ? EmbedForSeams(material, kCutDims, context)
                                                        : absl::StatusOr<Embedding>(embedding));
  TESSERA_ASSIGN_OR_RETURN(const IndexMaps maps, SynthesizeIndexMaps(Exemplar(laid_in, params.seam_rule),
                                                                     arrangement, params, context, controls));

  TileSet set = TileSetOfMaps(material, arrangement, maps, params);
  TESSERA_ASSIGN_OR_RETURN(Certificate certificate,
                           CertifyTiles(material, exemplar, arrangement, maps, params.strip_height,
                                        CertificateImages::kStratified, context));
  set.certificate = std::move(certificate.figures);
  set.seam_heat = std::move(certificate.heat);

  set.metadata = DescribeReports(maps);
  set.metadata["seed"] = params.seed;
  set.metadata["method"] = SynthesisMethodName(params.method);
  set.metadata["parameters"] = {{"tile_size", params.tile_size},
                                {"strip_height", params.strip_height},
                                {"mean_threshold", params.mean_threshold},
                                {"texel_threshold", params.texel_threshold},
                                {"seam_rule", params.seam_rule == SeamRule::kExcess ? "excess" : "mismatch"},
                                {"num_candidates", params.num_candidates},
                                {"effort", params.effort},
                                {"force", params.force}};
  set.metadata["exemplar"] = {{"width", material.width}, {"height", material.height}};
  set.metadata["captured_variance"] = DescribeCaptured(laid_in);
  set.metadata["pattern"] = DescribePattern(pattern);
  set.metadata["notes"] = SizeNotes(pattern, asked, params);
  set.metadata["warnings"] = PeriodWarnings(arrangement, pattern, params);
  const bool is_frame = params.method == SynthesisMethod::kFrame;
  if (!is_frame) {
    set.metadata["diamonds"] = {{"draws", maps.diamonds.num_draws},
                                {"most_draws", params.diamonds.num_draws},
                                {"overlap_error", maps.diamonds.overlap_error},
                                {"largest_error", params.diamonds.largest_error},
                                {"accepted", maps.diamonds.accepted}};
  }
  const int cut_length = (is_frame ? params.strip_height : params.tile_size) / 2;
  set.metadata["corners"] = {
      {"mean_mismatch", MismatchOfCost(static_cast<double>(maps.corner_cost)) /
                            static_cast<double>(std::max<int64_t>(1, maps.corner_seams) * cut_length)}};
  if (params.recipe) {
    set.metadata[kRecipeKey] = params.recipe->json;
    set.metadata["features"] = DescribeFeatures(features);
  }
  return set;
}

}  // namespace

absl::StatusOr<TileSet> SynthesizeTileSet(const Material& material, const Arrangement& arrangement,
                                          const SynthesisParams& params, const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckSizes(material.width, material.height, SmallestSizes(params)));
  if (params.recipe && params.method != SynthesisMethod::kFrame) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "method \"%s\" takes no recipe, only \"%s\" does", std::string(SynthesisMethodName(params.method)),
        std::string(SynthesisMethodName(SynthesisMethod::kFrame))));
  }
  const size_t num_pixels = static_cast<size_t>(material.width) * material.height;
  if (material.btfels.size() != num_pixels) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "material: %d BTFels for %dx%d texels", material.btfels.size(), material.width, material.height));
  }
  if (num_pixels > BtfelOfTexel(kNoTexel)) {
    return absl::InvalidArgumentError(
        absl::StrFormat("material %dx%d: more than 2^30 texels", material.width, material.height));
  }
  const Codec* const codec = FindCodec(material.btfels.codec_id);
  if (codec == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat("unknown codec '", material.btfels.codec_id, "'"));
  }
  TESSERA_ASSIGN_OR_RETURN(const Embedding embedding, codec->Embed(material, kCutDims, context));
  if (!params.recipe) {
    return SynthesizeEmbedded(material, embedding, {}, arrangement, params, context);
  }
  TESSERA_ASSIGN_OR_RETURN(const std::vector<Feature> features, ExtractFeatures(embedding, *params.recipe));
  if (params.recipe->colours.empty()) {
    return SynthesizeEmbedded(material, embedding, features, arrangement, params, context);
  }
  Material recoloured = material;
  TESSERA_RETURN_IF_ERROR(MoveColours(*params.recipe, features, recoloured));
  TESSERA_ASSIGN_OR_RETURN(const Embedding moved, codec->Embed(recoloured, kCutDims, context));
  return SynthesizeEmbedded(recoloured, moved, features, arrangement, params, context);
}

}  // namespace tessera
