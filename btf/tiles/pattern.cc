#include "btf/tiles/pattern.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/tiles/anisotropy.h"
#include "btf/tiles/autocorrelation.h"

namespace tessera {
namespace {

constexpr double kFeaturesPerWidth = 3.0;  // cos falls to a half after a sixth of a wave, on either side
constexpr int kStripsPerExemplar = 10;

// The mean over rings one texel wide, from no shift outwards.
std::vector<double> RadialMean(const Autocorrelation& autocorrelation) {
  const int reach = std::min(autocorrelation.most_x(), autocorrelation.most_y());
  std::vector<double> sums(reach + 1, 0.0);
  std::vector<int> counts(reach + 1, 0);
  for (int dy = 0; dy <= reach; ++dy) {
    for (int dx = -reach; dx <= reach; ++dx) {
      const auto ring = static_cast<int>(std::lround(std::hypot(dx, dy)));
      if (ring <= reach) {
        sums[ring] += autocorrelation.at(dx, dy);
        ++counts[ring];
      }
    }
  }
  for (int ring = 0; ring <= reach; ++ring) {
    sums[ring] /= counts[ring];
  }
  return sums;
}

double FeatureSize(const Autocorrelation& autocorrelation) {
  const std::vector<double> radial = RadialMean(autocorrelation);
  const double half = radial[0] / 2.0;
  if (half <= 0.0) {
    return 0.0;
  }
  size_t ring = 1;
  while (ring < radial.size() && radial[ring] > half) {
    ++ring;
  }
  const double radius = ring < radial.size() ? static_cast<double>(ring) -
                                                   (half - radial[ring]) / (radial[ring - 1] - radial[ring])
                                             : static_cast<double>(radial.size() - 1);
  return kFeaturesPerWidth * 2.0 * radius;
}

}  // namespace

absl::StatusOr<MaterialPattern> MeasurePattern(const Exemplar& exemplar, const RunContext& context) {
  MaterialPattern pattern;
  pattern.anisotropy = MeasureAnisotropy(exemplar, context);
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  TESSERA_ASSIGN_OR_RETURN(const Autocorrelation autocorrelation,
                           Autocorrelation::Of(FieldOfExemplar(exemplar), exemplar.search_dims(), 1,
                                               exemplar.width() / 2, exemplar.height() / 2, context));
  pattern.feature_size = FeatureSize(autocorrelation);
  pattern.period = FindPeriod(autocorrelation);
  return pattern;
}

absl::StatusOr<MaterialPattern> MeasureMaterialPattern(const Material& material, const RunContext& context) {
  const Codec* const codec = FindCodec(material.btfels.codec_id);
  if (codec == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat("unknown codec '", material.btfels.codec_id, "'"));
  }
  TESSERA_ASSIGN_OR_RETURN(const Embedding embedding, codec->Embed(material, kCutDims, context));
  return MeasurePattern(Exemplar(embedding), context);
}

nlohmann::json DescribePattern(const MaterialPattern& pattern) {
  nlohmann::json figures = {{"anisotropy", pattern.anisotropy},
                            {"anisotropy_limit", kAnisotropyLimit},
                            {"feature_size", pattern.feature_size}};
  if (pattern.period) {
    figures["period"] = pattern.period->vectors;
  }
  return figures;
}

int StripHeightFor(const MaterialPattern& pattern, int exemplar_width, int exemplar_height, int tile_size) {
  const int most = std::min(tile_size / 2, std::min(exemplar_width, exemplar_height) / kStripsPerExemplar);
  const double wanted = std::min(pattern.feature_size, static_cast<double>(most));
  const int height = 2 * static_cast<int>(std::lround(wanted / 2.0));
  return std::max(kSmallestStrip, height > most ? height - 2 : height);
}

int TileSizeFor(const MaterialPattern& pattern, int strip_height, bool keep_period) {
  const int least = 2 * std::max(kSmallestStrip, strip_height);
  const int usual = std::max(kDefaultTileSize, least);
  if (!keep_period || !pattern.period) {
    return usual;
  }
  return TileSizeInStep(*pattern.period, usual, least, 2 * usual).value_or(usual);
}

}  // namespace tessera
