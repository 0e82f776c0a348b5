#include "btf/chart/codec_chart.h"

#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <sstream>
#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/codec/decoder.h"
#include "btf/data/direction_sets.h"
#include "btf/data/memory_btf.h"
#include "btf/render/offscreen_context.h"
#include "tests/support/noise_btf.h"
#include "tests/support/read_btf.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kSide = 16;

NoiseBtf Source() {
  // Rings at 9, 27, 45, 63 and 81 degrees: every class of angles but one has pairs.
  return NoiseBtf(kSide, kSide, *DirectionSet("5x6"), *DirectionSet("5x6"));
}

const ChartPoint& PointOf(const SourceChart& chart, const std::string& method, const std::string& setting) {
  for (const ChartPoint& point : chart.points) {
    if (point.method == method && point.setting == setting) {
      return point;
    }
  }
  ADD_FAILURE() << method << " " << setting;
  return chart.points[0];
}

// Root mean square error over pairs whose angles are at most the limit, texel by texel.
double DirectRmse(const Material& material, NoiseBtf& source, const PairSet& pairs, double limit_deg,
                  int row_stride) {
  const std::vector<float> samples = AllSamples(source);
  const auto decoder = MakeDecoder(material.btfels);
  const BtfInfo& info = source.info();
  double squares = 0.0;
  double count = 0.0;
  for (const int v : pairs.views) {
    for (const int l : pairs.lights) {
      if (DegFromRad(std::max(info.views[v].theta_rad, info.lights[l].theta_rad)) > limit_deg + 1e-6) {
        continue;
      }
      for (int y = 0; y < kSide; y += row_stride) {
        for (int x = 0; x < kSide; ++x) {
          const Eigen::Array3d rgb =
              (*decoder)->Decode(material.btfels.btfel(y * kSide + x), VectorFromDirection(info.lights[l]),
                                 VectorFromDirection(info.views[v]), 0);
          for (int c = 0; c < 3; ++c) {
            const double truth =
                samples[(((y * kSide + x) * 3 + c) * info.views.size() + v) * info.lights.size() + l];
            squares += std::pow(rgb[c] - truth, 2);
            count += 1.0;
          }
        }
      }
    }
  }
  return std::sqrt(squares / count);
}

void ExpectDirectFigures(const SourceChart& chart) {
  NoiseBtf source = Source();
  const Codec& codec = *FindCodec("dsh-cls");
  const EncodeParams params{.kl = 4, .kv = 4};
  const ChartPoint& point = PointOf(chart, "dsh-cls", "4x4");
  const int row_stride = chart.row_stride;
  EXPECT_EQ(row_stride, 2);
  // DecodeTexels is in single precision.
  constexpr double kRounding = 1e-5;

  const auto all = codec.Encode(source, params, {});
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(point.size_bytes, SerializeMaterial(*all)->size());
  for (size_t limit = 0; limit < kNumAngleLimits; ++limit) {
    EXPECT_NEAR((*point.splits[0])[limit].squares.rmse(),
                DirectRmse(*all, source, MeasuredPairs(source.info(), Split::kSampled),
                           kAngleLimitsDeg[limit], row_stride),
                kRounding)
        << limit;
  }
  const auto views = SubsetBtf::Create(source, {.views = KeptDirections(30)});
  const auto without = codec.Encode(**views, params, {});
  ASSERT_TRUE(without.ok());
  EXPECT_NEAR(
      (*point.splits[2])[0].squares.rmse(),
      DirectRmse(*without, source, MeasuredPairs(source.info(), Split::kHeldOutViews), 45.0, row_stride),
      kRounding);
  EXPECT_NEAR(
      (*point.splits[2])[3].squares.rmse(),
      DirectRmse(*without, source, MeasuredPairs(source.info(), Split::kHeldOutViews), 90.0, row_stride),
      kRounding);
}

void ExpectEveryCodecWithItsCosts(const SourceChart& chart) {
  std::set<std::string> methods;
  for (const ChartPoint& point : chart.points) {
    methods.insert(point.method);
    EXPECT_EQ(point.refusal, "") << point.method;
    EXPECT_GT(point.size_bytes, 0U);
    EXPECT_GT(point.cpu.streaming_s, 0.0);
    EXPECT_EQ(point.gl.has_value(), point.method != kJpegMethod);
    ASSERT_EQ(point.crops.size(), chart.crops.size());
    for (const auto& split : point.splits) {
      ASSERT_TRUE(split.has_value());
      EXPECT_GT((*split)[3].dssim, 0.0);
      EXPECT_GT((*split)[3].flip, 0.0);
      // A wider limit has all pairs of a narrower one.
      EXPECT_LT((*split)[0].num_pairs, (*split)[3].num_pairs);
    }
    EXPECT_EQ((*point.splits[0])[3].num_pairs, 900);
    EXPECT_EQ((*point.splits[1])[3].num_pairs, 180);
  }
  for (const std::string_view codec : CodecIds()) {
    EXPECT_EQ(methods.count(std::string(codec)), 1U) << codec;
  }
  EXPECT_EQ(methods.count(kJpegMethod), 1U);
  // Both groups compare one setting a method.
  ASSERT_EQ(chart.groups.size(), 2U);
  EXPECT_EQ(chart.groups[0].points.size(), methods.size());
}

// One test, for the chart takes half a minute.
TEST(CodecChartTest, HasEveryCodecWithFiguresThatADirectComputationGives) {
  NoiseBtf source = Source();
  const auto gl = CreateOsmesaContext();
  ASSERT_TRUE(gl.ok()) << gl.status();
  const auto chart = ChartCodecs("tiny", source, ChartSize::kQuick, **gl, {});
  ASSERT_TRUE(chart.ok()) << chart.status();
  ExpectDirectFigures(*chart);
  ExpectEveryCodecWithItsCosts(*chart);
}

// Two points of made-up figures and a refused one.
SourceChart HandMade() {
  SourceChart chart{.name = "hand, <made>", .width = 4, .height = 4};
  chart.views = *DirectionSet("1x5");
  chart.lights = *DirectionSet("1x5");
  chart.row_stride = 2;
  chart.pictures_per_class = 8;
  ChartPoint point{.method = "dsh", .setting = "4x4", .size_bytes = 1000, .encode_s = 1.5};
  point.cpu = {.streaming_s = 2e-9, .random_s = 3e-6};
  point.gl = GlFrameCost{.nearest_s = 0.1, .bilinear_s = 0.3, .prepare_s = 0.05};
  SplitFigures figures;
  for (size_t limit = 0; limit < kNumAngleLimits; ++limit) {
    figures[limit] = {
        .squares = {.errors = 1.0, .references = 25.0, .coded_errors = 0.01, .num_samples = 100},
        .num_pairs = static_cast<int64_t>(limit) * 5,
        .dssim = 0.02,
        .flip = 0.03,
        .num_pictures = 7};
  }
  point.splits = {figures, figures, figures};
  point.crops = {Image(4, 4, 3)};
  chart.points.push_back(point);
  point.method = kJpegMethod;
  point.setting = "q 10";
  point.gl = std::nullopt;
  point.splits[1] = std::nullopt;
  chart.points.push_back(point);
  chart.points.push_back({.method = "dfmf", .setting = "rank 0", .refusal = "rank 0, expected more"});
  chart.crops.push_back({.title = "one", .reference = Image(4, 4, 3)});
  chart.groups.push_back({"all", {0, 1}});
  return chart;
}

std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells(1);
  bool is_quoted = false;
  for (const char c : line) {
    if (c == '"') {
      is_quoted = !is_quoted;
    } else if (c == ',' && !is_quoted) {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

TEST(CodecChartTest, CsvHasOneRowASplitAndLimitThatHasPairs) {
  std::istringstream csv(CodecsCsv({HandMade()}));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(
      line,
      "source,method,setting,split,angle_limit_deg,bytes,rate,encode_s,encode_cpu_s,streaming_ns,random_us,"
      "gl_nearest_ms,gl_bilinear_ms,gl_prepare_ms,rmse,relative_rmse,psnr_db,dssim,flip,pairs,row_stride,"
      "pictures,"
      "pictures_per_class,refusal");
  const size_t num_columns = Cells(line).size();
  std::map<std::string, int> rows;
  std::string first;
  while (std::getline(csv, line)) {
    const std::vector<std::string> cells = Cells(line);
    ASSERT_EQ(cells.size(), num_columns) << line;
    ++rows[cells[1]];
    first = first.empty() ? line : first;
  }
  EXPECT_EQ(
      first,
      "\"hand, <made>\",dsh,4x4,sampled,60,1000,0.833333,1.5,0,2,3,100,300,50,0.1,0.2,40,0.02,0.03,5,2,7,8,");
  // Nothing lies up to 45 degrees; JPEG has two splits here.
  EXPECT_EQ(rows, (std::map<std::string, int>{{"dsh", 9}, {kJpegMethod, 6}, {"dfmf", 1}}));
}

TEST(CodecChartTest, PageIsSelfContained) {
  const PaperRow row{.side = 800, .kv = 25, .kl = 25, .paper_s = 10289.0, .paper_rate = 0.0953};
  const auto html = CodecsHtml({HandMade()}, {row});
  ASSERT_TRUE(html.ok()) << html.status();
  for (const char* const text : {"hand, &lt;made&gt;", "Pareto front", "data:image/png;base64,", "2:51:29",
                                 "not run", "rank 0, expected more", "dsh 4x4: 0.00 MB, 0.1000"}) {
    EXPECT_THAT(*html, HasSubstr(text));
  }
  for (const char* const text : {"src=\"http", "<link", "<script", "nan"}) {
    EXPECT_THAT(*html, Not(HasSubstr(text)));
  }
}

TEST(CodecChartTest, SaysWhenEveryCodecRefusesAndStopsWhenAsked) {
  const auto gl = CreateOsmesaContext();
  ASSERT_TRUE(gl.ok());
  BtfInfo info{.width = 8, .height = 8, .views = *DirectionSet("1x3"), .lights = *DirectionSet("1x2")};
  std::vector<float> samples(8 * 8 * 3 * 6, 0.5F);
  samples[100] = std::nanf("");
  auto source = MemoryBtf::Create(info, std::move(samples));
  ASSERT_TRUE(source.ok());
  const auto refused = ChartCodecs("broken", **source, ChartSize::kQuick, **gl, {});
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("broken"));

  std::stop_source stop;
  stop.request_stop();
  RunContext context;
  context.stop = stop.get_token();
  NoiseBtf tiny = Source();
  EXPECT_EQ(ChartCodecs("tiny", tiny, ChartSize::kQuick, **gl, context).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
