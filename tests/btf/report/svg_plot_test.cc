#include "btf/report/svg_plot.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Plot TwoSeries() {
  Plot plot{.title = "a < b", .x = {"size", AxisUnit::kBytes}, .y = {"error"}};
  plot.series.push_back({"one", "#111111", Marker::kCircle, {{1e6, 0.1, "first"}, {1e7, 0.01, "second"}}});
  plot.series.push_back(
      {"two", "#222222", Marker::kCross, {{2e7, 0.05, "beaten"}, {-1.0, 1.0, "lost"}, {1.0, NAN, "none"}}});
  return plot;
}

TEST(SvgPlotTest, NamesAxesPointsAndFront) {
  const std::string svg = SvgOf(TwoSeries());
  EXPECT_THAT(svg, HasSubstr("a &lt; b"));
  EXPECT_THAT(svg, HasSubstr(">10 MB</text>"));
  EXPECT_THAT(svg, HasSubstr("one first: 1 MB, 0.1, on the front</title>"));
  EXPECT_THAT(svg, HasSubstr("two beaten: 20 MB, 0.05</title>"));
  // What a logarithmic axis cannot show is left out.
  EXPECT_THAT(svg, Not(HasSubstr("lost")));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(SvgPlotTest, WhatLiesBeyondIsMarkedAtTheEdge) {
  Plot plot = TwoSeries();
  plot.y.to = 0.06;
  EXPECT_THAT(SvgOf(plot), HasSubstr("one first: 1 MB, 0.1, on the front, beyond the edge"));
}

TEST(SvgPlotTest, NothingToShowIsAnEmptyFrame) {
  const Plot plot{.title = "empty", .x = {"x"}, .y = {"y"}};
  EXPECT_THAT(SvgOf(plot), HasSubstr("</svg>"));
}

}  // namespace
}  // namespace tessera
