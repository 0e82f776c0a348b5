#include "btf/chart/synthesis_chart.h"

#include <algorithm>
#include <sstream>
#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/data/direction_sets.h"
#include "tests/support/noise_btf.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

NoiseBtf SquareSource(int side) {
  return NoiseBtf(side, side, *DirectionSet("2x5"), *DirectionSet("2x5"));
}

TEST(SynthesisChartTest, VariesOneParameterAtATimeAndJudgesAllMethodsAlike) {
  NoiseBtf source = SquareSource(70);
  const auto chart = ChartSynthesis("noise", source, ChartSize::kQuick, {});
  ASSERT_TRUE(chart.ok()) << chart.status();
  EXPECT_EQ(chart->width, 64);
  EXPECT_EQ(chart->sheets.size(), kChartedMethods.size());
  EXPECT_EQ(static_cast<int>(chart->captured.size()), chart->embedding_dims);
  for (size_t method = 0; method < kChartedMethods.size(); ++method) {
    const SynthesisSetting common = chart->common(method);
    const bool is_diamond = kChartedMethods[method].method != SynthesisMethod::kFrame;
    int num_common = 0;
    int num_all_layers = 0;
    for (const SynthesisPoint& point : chart->points) {
      if (point.method != method) {
        continue;
      }
      const SynthesisSetting& setting = point.setting;
      const int num_varied =
          (setting.dims != common.dims ? 1 : 0) + (setting.candidates != common.candidates ? 1 : 0) +
          (setting.strip_height != common.strip_height ? 1 : 0) + (setting.seed != common.seed ? 1 : 0);
      num_common += num_varied == 0 ? 1 : 0;
      EXPECT_LE(num_varied, 1);
      EXPECT_GT(point.seconds, 0.0);
      EXPECT_EQ(point.draws > 0, is_diamond);
      EXPECT_LE(point.draws, is_diamond ? setting.candidates : 0);
      EXPECT_GT(point.insides_ratio, 0.5);
      // Where neighbours are independent of each other, so are the texels at a seam.
      EXPECT_NEAR(point.seen_ratio, 1.0, 0.2);
      EXPECT_GT(point.seen_error, 0.0);
      if (setting.dims == chart->embedding_dims) {
        EXPECT_DOUBLE_EQ(point.seen_error, point.full_error);
        ++num_all_layers;
      }
    }
    EXPECT_EQ(num_common, 1);
    EXPECT_EQ(num_all_layers, 1);
  }
}

// Two points of made-up figures.
SynthesisChart MadeUpChart() {
  SynthesisChart chart{.name = "hand, <made>",
                       .width = 64,
                       .height = 64,
                       .tile_size = 32,
                       .size = ChartSize::kQuick,
                       .embedding_dims = 2,
                       .captured = {0.5, 0.75}};
  for (const size_t method : {size_t{0}, size_t{3}}) {
    SynthesisPoint point{.method = method, .setting = chart.common(method), .seconds = 1.5};
    point.borders_ratio = 1.25;
    point.insides_ratio = 1.5;
    point.insides_cut_share = 0.1;
    point.seen_ratio = 1.75;
    point.seen_error = 0.3;
    point.full_error = 0.4;
    point.repetition = 2.0;
    chart.points.push_back(point);
  }
  chart.sheets = {Image(4, 4, 3)};
  return chart;
}

TEST(SynthesisChartTest, CsvHasOneRowAPoint) {
  std::istringstream csv(SynthesisCsv({MadeUpChart()}));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(
      line,
      "source,width,height,tile_size,method,seam_rule,dims,candidates,strip_height,seed,seconds,draws,"
      "borders_ratio,insides_ratio,insides_ratio_p95,insides_cut_share,seen_ratio,seen_error,full_error,"
      "repetition,referenced_share");
  std::getline(csv, line);
  EXPECT_EQ(line,
            "\"hand, <made>\",64,64,32,diamond-dp,mismatch,32,256,8,1,1.5,0,1.25,1.5,0,0.1,1.75,0.3,0.4,2,0");
  std::getline(csv, line);
  EXPECT_EQ(line, "\"hand, <made>\",64,64,32,frame,excess,32,16,8,1,1.5,0,1.25,1.5,0,0.1,1.75,0.3,0.4,2,0");
  EXPECT_FALSE(std::getline(csv, line));
}

TEST(SynthesisChartTest, PageIsSelfContained) {
  TilesRow row{.material = "HOLES", .source = "generated:holes", .side = 128, .tile_size = 100, .k = 25};
  row.paper_minutes = 25;
  row.run = TilesRun{.seconds = 30.0, .referenced_share = 0.5, .btfel_bytes = 15360000};
  const auto html = SynthesisHtml({MadeUpChart()}, {row});
  ASSERT_TRUE(html.ok()) << html.status();
  for (const char* const text : {"hand, &lt;made&gt;", "frame, excess", "data:image/png;base64,", "R 1.500",
                                 "50x", "15.36", "1: 50.0%, 2: 75.0%."}) {
    EXPECT_THAT(*html, HasSubstr(text));
  }
  for (const char* const text : {"src=\"http", "<link", "<script", "nan"}) {
    EXPECT_THAT(*html, Not(HasSubstr(text)));
  }
}

TEST(SynthesisChartTest, RefusesWhatIsTooSmallAndStopsWhenAsked) {
  NoiseBtf small = SquareSource(32);
  const auto refused = ChartSynthesis("small", small, ChartSize::kQuick, {});
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("small: 32x32 texels"));

  std::stop_source stop;
  RunContext context;
  context.stop = stop.get_token();
  context.progress = [&](const Progress& progress) {
    if (progress.stage == "chart") {
      stop.request_stop();
    }
  };
  NoiseBtf source = SquareSource(64);
  EXPECT_EQ(ChartSynthesis("noise", source, ChartSize::kQuick, context).status().code(),
            absl::StatusCode::kCancelled);
}

TEST(TilesTableTest, CsvHasThePapersFiguresAndOurs) {
  TilesRow row{.material = "HOLES",
               .source = "generated:holes",
               .side = 128,
               .tile_size = 100,
               .k = 25,
               .paper_minutes = 25,
               .paper_share = 0.3486,
               .paper_megabytes = 10.72,
               .run = TilesRun{.seconds = 30.0, .referenced_share = 0.5, .btfel_bytes = 15360000}};
  std::istringstream csv(TilesCsv({row}));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line,
            "material,texels,tile_size,kv,kl,method,source,seconds,embed_s,referenced_share,megabytes,"
            "insides_ratio");
  std::getline(csv, line);
  EXPECT_EQ(line, "HOLES,128x128,100,25,25,paper,,1500,,0.3486,10.72,");
  std::getline(csv, line);
  EXPECT_EQ(line, "HOLES,128x128,100,25,25,frame,generated:holes,30.00,0.00,0.5000,15.36,0.0000");
}

}  // namespace
}  // namespace tessera
