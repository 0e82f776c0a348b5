#include "btf/chart/synthesis_chart.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <numeric>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/data/subset_btf.h"
#include "btf/render/sheet.h"
#include "btf/report/page.h"
#include "btf/tiles/certificate.h"
#include "btf/tiles/index_maps.h"
#include "btf/tiles/repetition.h"
#include "btf/tiles/seam_embedding.h"
#include "btf/tiles/seam_graph.h"

namespace tessera {
namespace {

constexpr char kChartedCodec[] = "dsh";
constexpr char kArrangement[] = "plane-16";
// Of texels in that arrangement: those of tiles, and of borders as they lie in a vertical strip's frame.
constexpr std::array kTurns = {0, 3};
constexpr int kMostDims = 64;

// What is varied, and about which values.
struct Plan {
  int most_side = 0;  // of the part charted, the middle
  int tile_size = 0;
  int strip_height = 0;
  int num_seeds = 0;  // at the common setting
  std::vector<int> dims;
  std::vector<int> draws;
  std::vector<int> patches;
  std::vector<int> strip_heights;
};

Plan PlanOf(ChartSize size) {
  if (size == ChartSize::kQuick) {
    return {.most_side = 64,
            .tile_size = 32,
            .strip_height = 8,
            .num_seeds = 1,
            .dims = {4, 32, kMostDims},
            .draws = {1, 256},
            .patches = {1, 16},
            .strip_heights = {8, 16}};
  }
  return {.most_side = 256,
          .tile_size = 64,
          .strip_height = 16,
          .num_seeds = 3,
          .dims = {2, 4, 8, 16, 32, kMostDims},
          .draws = {1, 16, 256, 2048},
          .patches = {1, 4, 16},
          .strip_heights = {8, 16, 32}};
}

bool IsDiamond(size_t method) {
  return kChartedMethods[method].method != SynthesisMethod::kFrame;
}

SynthesisSetting CommonSetting(ChartSize size, size_t method) {
  const SynthesisParams defaults;
  return {.dims = kCutDims,
          .candidates = IsDiamond(method) ? defaults.diamonds.num_draws : defaults.num_candidates,
          .strip_height = PlanOf(size).strip_height,
          .seed = 1};
}

// Each once, the common one first.
std::vector<SynthesisSetting> SettingsOf(ChartSize size, size_t method, int embedding_dims) {
  const Plan plan = PlanOf(size);
  const SynthesisSetting common = CommonSetting(size, method);
  std::vector<SynthesisSetting> settings;
  const auto add = [&](auto member, auto value) {
    SynthesisSetting setting = common;
    setting.*member = value;
    if (std::ranges::find(settings, setting) == settings.end()) {
      settings.push_back(setting);
    }
  };
  for (int seed = 1; seed <= plan.num_seeds; ++seed) {
    add(&SynthesisSetting::seed, static_cast<uint64_t>(seed));
  }
  for (const int dims : plan.dims) {
    if (dims <= embedding_dims) {
      add(&SynthesisSetting::dims, dims);
    }
  }
  // What diamonds score depends on a few samples; they are quick, so that seeds can be averaged.
  for (int seed = 2; IsDiamond(method) && seed <= plan.num_seeds; ++seed) {
    for (const int dims : plan.dims) {
      if (dims <= embedding_dims && dims != common.dims) {
        settings.push_back(common);
        settings.back().dims = dims;
        settings.back().seed = static_cast<uint64_t>(seed);
      }
    }
  }
  for (const int candidates : IsDiamond(method) ? plan.draws : plan.patches) {
    add(&SynthesisSetting::candidates, candidates);
  }
  for (const int strip_height : plan.strip_heights) {
    add(&SynthesisSetting::strip_height, strip_height);
  }
  return settings;
}

// Of the seams within tiles, see SynthesisPoint. `exemplar` has SeamRule::kMismatch.
double MeanMismatch(const Exemplar& exemplar, const std::vector<CutPair>& pairs) {
  double cost = 0.0;
  for (const CutPair& pair : pairs) {
    cost += PairCost(exemplar, pair.a, pair.b, pair.direction);
  }
  const double mean = cost / static_cast<double>(std::max<size_t>(1, pairs.size()));
  return MismatchOfCost(mean) * exemplar.mean_step() / exemplar.spread();
}

// Of the seams within tiles, see SynthesisPoint::seen_ratio.
double StepRatio(const Exemplar& exemplar, const std::vector<CutPair>& pairs) {
  double step = 0.0;
  double own_step = 0.0;
  for (const CutPair& pair : pairs) {
    step += exemplar.Distance(pair.a, pair.b);
    own_step += OwnStep(exemplar, pair.a, pair.b, pair.direction);
  }
  return own_step > 0.0 ? step / own_step : 1.0;
}

// The middle of 0 .. side - 1.
std::vector<int> Middle(int side, int most) {
  std::vector<int> indices(std::min(side, most));
  std::iota(indices.begin(), indices.end(), (side - static_cast<int>(indices.size())) / 2);
  return indices;
}

class SynthesisRun {
 public:
  // `embedding` is the codec's, `for_seams` what our method lays tiles in.
  SynthesisRun(const Material& material, const Embedding& embedding, const Embedding& for_seams,
               const RunContext& context, SynthesisChart& chart)
      : material_(material),
        embedding_(embedding),
        for_seams_(for_seams),
        judge_(embedding),
        full_(embedding, SeamRule::kMismatch, embedding.dims),
        arrangement_(**FindArrangement(kArrangement)),
        context_(context),
        quiet_(context),
        chart_(chart) {
    quiet_.progress = nullptr;
  }

  absl::Status Run() {
    TESSERA_RETURN_IF_ERROR(Decode());
    std::vector<SynthesisPoint> points;
    for (size_t method = 0; method < kChartedMethods.size(); ++method) {
      for (const SynthesisSetting& setting : SettingsOf(chart_.size, method, embedding_.dims)) {
        points.push_back({.method = method, .setting = setting});
      }
    }
    for (size_t i = 0; i < points.size(); ++i) {
      context_.Report("chart", i, points.size(), "settings");
      TESSERA_RETURN_IF_ERROR(Measure(points[i]));
    }
    context_.Report("chart", points.size(), points.size(), "settings");
    chart_.points = std::move(points);
    return absl::OkStatus();
  }

 private:
  // Once for all points, which CertifyTiles would not do.
  absl::Status Decode() {
    const BtfelTable& table = material_.btfels;
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table));
    const std::vector<ImagePair> pairs =
        ChooseImages(static_cast<int>(table.views.size()), static_cast<int>(table.lights.size()),
                     CertificateImages::kStratified);
    images_.resize(pairs.size());
    for (ExemplarImage& image : images_) {
      for (const int turn : kTurns) {
        image.rgb[turn].resize(3 * table.size());
      }
    }
    DecodeExemplarImages(*decoder, table, pairs, context_, images_);
    return context_.CheckStop();
  }

  absl::Status Measure(SynthesisPoint& point) {
    const SynthesisSetting& setting = point.setting;
    SynthesisParams params;
    params.method = point.charted().method;
    params.seam_rule = point.charted().seam_rule;
    params.tile_size = chart_.tile_size;
    params.strip_height = setting.strip_height;
    params.seed = setting.seed;
    params.force = true;
    (IsDiamond(point.method) ? params.diamonds.num_draws : params.num_candidates) = setting.candidates;
    const auto start = std::chrono::steady_clock::now();
    const Embedding& laid_in = params.seam_rule == SeamRule::kExcess ? for_seams_ : embedding_;
    const Exemplar exemplar(laid_in, params.seam_rule, setting.dims);
    TESSERA_ASSIGN_OR_RETURN(const IndexMaps maps,
                             SynthesizeIndexMaps(exemplar, arrangement_, params, quiet_));
    point.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    point.draws = maps.diamonds.num_draws;

    SeamMeter borders(judge_, BorderSeams(judge_, arrangement_, maps));
    SeamMeter insides(judge_, InsideSeams(judge_, maps));
    borders.Add(images_, quiet_);
    insides.Add(images_, quiet_);
    const nlohmann::json described = insides.Describe();
    point.borders_ratio = borders.Ratio();
    point.insides_ratio = insides.Ratio();
    point.insides_ratio_p95 = described["ratio_p95"].get<double>();
    point.insides_cut_share = described["cut_share"].get<double>();
    TESSERA_ASSIGN_OR_RETURN(const nlohmann::json repetition,
                             MeasureRepetition(judge_, arrangement_, maps, params.strip_height, quiet_));
    point.repetition = repetition["ratio"].get<double>();
    const Exemplar seen(embedding_, SeamRule::kMismatch, setting.dims);
    point.seen_ratio = StepRatio(seen, insides.seams().pairs);
    point.seen_error = MeanMismatch(seen, insides.seams().pairs);
    point.full_error = MeanMismatch(full_, insides.seams().pairs);
    TileSet tiles = TileSetOfMaps(material_, arrangement_, maps, params);
    point.referenced_share = static_cast<double>(tiles.btfels.size()) / judge_.num_pixels();

    if (setting == chart_.common(point.method)) {
      tiles.seam_heat = HeatOf(std::array<const SeamMeter*, 2>{&borders, &insides}, maps.texels.size());
      TESSERA_ASSIGN_OR_RETURN(Image sheet, RenderTileSheet(tiles, {.seam_heat = true}, quiet_));
      chart_.sheets.push_back(std::move(sheet));
    }
    return absl::OkStatus();
  }

  const Material& material_;
  const Embedding& embedding_;
  const Embedding& for_seams_;
  Exemplar judge_;  // the same for every point
  Exemplar full_;
  const Arrangement& arrangement_;
  const RunContext& context_;
  RunContext quiet_;
  SynthesisChart& chart_;
  std::vector<ExemplarImage> images_;  // that R is measured in
};

std::string FigureText(double value) {
  return absl::StrFormat("%.6g", value);
}

}  // namespace

SynthesisSetting SynthesisChart::common(size_t method) const {
  return CommonSetting(size, method);
}

absl::StatusOr<SynthesisChart> ChartSynthesis(const std::string& name, BtfSource& source, ChartSize size,
                                              const RunContext& context) {
  const Plan plan = PlanOf(size);
  const BtfInfo& info = source.info();
  // Samples of diamonds need room to be drawn from.
  const int least = plan.tile_size * 3 / 2;
  if (std::min(info.width, info.height) < least) {
    return absl::InvalidArgumentError(absl::StrFormat("%s: %dx%d texels, the chart's tiles of %d need %d",
                                                      name, info.width, info.height, plan.tile_size, least));
  }
  const BtfSubset subset{.columns = Middle(info.width, plan.most_side),
                         .rows = Middle(info.height, plan.most_side)};
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<SubsetBtf> part, SubsetBtf::Create(source, subset));
  TESSERA_ASSIGN_OR_RETURN(const Material material, FindCodec(kChartedCodec)->Encode(*part, {}, context));
  const auto start = std::chrono::steady_clock::now();
  TESSERA_ASSIGN_OR_RETURN(const Embedding embedding,
                           FindCodec(kChartedCodec)->Embed(material, kMostDims, context));
  TESSERA_ASSIGN_OR_RETURN(const Embedding for_seams, EmbedForSeams(material, kMostDims, context));
  SynthesisChart chart{.name = name,
                       .width = material.width,
                       .height = material.height,
                       .tile_size = plan.tile_size,
                       .size = size,
                       .embedding_dims = embedding.dims};
  chart.embed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  double captured = 0.0;
  for (const double variance : embedding.variance) {
    captured += variance;
    chart.captured.push_back(embedding.total_variance > 0.0 ? captured / embedding.total_variance : 1.0);
  }
  TESSERA_RETURN_IF_ERROR(SynthesisRun(material, embedding, for_seams, context, chart).Run());
  return chart;
}

std::string SynthesisCsv(const std::vector<SynthesisChart>& charts) {
  std::string csv = CsvLine({"source",
                             "width",
                             "height",
                             "tile_size",
                             "method",
                             "seam_rule",
                             "dims",
                             "candidates",
                             "strip_height",
                             "seed",
                             "seconds",
                             "draws",
                             "borders_ratio",
                             "insides_ratio",
                             "insides_ratio_p95",
                             "insides_cut_share",
                             "seen_ratio",
                             "seen_error",
                             "full_error",
                             "repetition",
                             "referenced_share"});
  for (const SynthesisChart& chart : charts) {
    for (const SynthesisPoint& point : chart.points) {
      csv += CsvLine({chart.name,
                      absl::StrCat(chart.width),
                      absl::StrCat(chart.height),
                      absl::StrCat(chart.tile_size),
                      std::string(SynthesisMethodName(point.charted().method)),
                      point.charted().seam_rule == SeamRule::kExcess ? "excess" : "mismatch",
                      absl::StrCat(point.setting.dims),
                      absl::StrCat(point.setting.candidates),
                      absl::StrCat(point.setting.strip_height),
                      absl::StrCat(point.setting.seed),
                      FigureText(point.seconds),
                      absl::StrCat(point.draws),
                      FigureText(point.borders_ratio),
                      FigureText(point.insides_ratio),
                      FigureText(point.insides_ratio_p95),
                      FigureText(point.insides_cut_share),
                      FigureText(point.seen_ratio),
                      FigureText(point.seen_error),
                      FigureText(point.full_error),
                      FigureText(point.repetition),
                      FigureText(point.referenced_share)});
    }
  }
  return csv;
}

}  // namespace tessera
