#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <optional>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "btf/base/status_macros.h"
#include "btf/chart/codec_chart.h"
#include "btf/chart/page_parts.h"
#include "btf/chart/page_style.h"
#include "btf/report/page.h"
#include "btf/report/pareto.h"
#include "btf/report/svg_plot.h"

namespace tessera {
namespace {

constexpr char kTitle[] = "Codecs: bytes, speed, error";
constexpr char kStyle[] = R"(
.tabs > input { position: absolute; opacity: 0; }
.tabs > label { display: inline-block; padding: .25em 1em; border: 1px solid #d0d7de; border-radius: 1em; margin-right: .4em; cursor: pointer; }
.tabs > input:checked + label { background: #1f2328; color: #fff; border-color: #1f2328; }
.tabs > input:focus-visible + label { outline: 2px solid #0969da; }
.panel { display: none; margin-top: .6em; }
.tabs > input:nth-of-type(1):checked ~ .panel:nth-of-type(1), .tabs > input:nth-of-type(2):checked ~ .panel:nth-of-type(2), .tabs > input:nth-of-type(3):checked ~ .panel:nth-of-type(3) { display: block; }
.crops { display: flex; gap: 8px; margin: .3em 0 1em; flex-wrap: wrap; }
.crops figure { margin: 0; width: 150px; font-size: 12px; line-height: 1.35; }
.crops img { width: 150px; image-rendering: pixelated; display: block; margin-bottom: 2px; background: #000; }
.crops figcaption b { display: block; }
.crops .blank { width: 150px; height: 150px; display: flex; align-items: center; justify-content: center; color: #57606a; border: 1px dashed #d0d7de; box-sizing: border-box; margin-bottom: 2px; text-align: center; }
p.pair { margin: 1em 0 .2em; font-weight: 600; }
table.front td { min-width: 15em; }
table.front b, table td.method { white-space: nowrap; }
i.swatch { display: inline-block; width: .75em; height: .75em; border-radius: 50%; margin-right: .45em; }
)";

struct Look {
  const char* colour;
  Marker marker;
};

// Colours that are told apart by everyone (Okabe and Ito), and shapes beside them.
Look LookOf(const std::string& method) {
  static const std::map<std::string, Look> looks = {
      {"dsh-ls", {"#8c959f", Marker::kPlus}},        {"dsh-cls", {"#0072b2", Marker::kSquare}},
      {"dsh-cls 4pi", {"#56b4e9", Marker::kSquare}}, {"dsh", {"#009e73", Marker::kDiamond}},
      {"view-pca", {"#cc79a7", Marker::kTriangle}},  {"dfmf", {"#d55e00", Marker::kCircle}},
      {kJpegMethod, {"#1f2328", Marker::kCross}}};
  const auto found = looks.find(method);
  return found == looks.end() ? Look{"#8250df", Marker::kCircle} : found->second;
}

struct Metric {
  const char* name;
  const char* axis;
  double (*of)(const LimitFigures& figures);
};
constexpr std::array kMetrics = {
    Metric{"RMSE", "RMSE, linear reflectance", [](const LimitFigures& f) { return f.squares.rmse(); }},
    Metric{"DSSIM", "DSSIM, (1 - SSIM) / 2", [](const LimitFigures& f) { return f.dssim; }},
    Metric{"FLIP", "FLIP, 67 pixels a degree", [](const LimitFigures& f) { return f.flip; }}};

struct Cost {
  const char* name;
  const char* axis;
  AxisUnit unit;
  std::optional<double> (*of)(const ChartPoint& point);
};
constexpr std::array kCosts = {
    Cost{"bytes", "bytes of the whole container", AxisUnit::kBytes,
         [](const ChartPoint& p) { return std::optional(static_cast<double>(p.size_bytes)); }},
    Cost{"decoding on the CPU", "ns a texel, one core, all texels of a picture", AxisUnit::kNumber,
         [](const ChartPoint& p) { return std::optional(1e9 * p.cpu.streaming_s); }},
    Cost{"decoding in a GL frame", "ms a frame of 640x480, bilinear", AxisUnit::kNumber,
         [](const ChartPoint& p) { return p.gl ? std::optional(1e3 * p.gl->bilinear_s) : std::nullopt; }}};

// The points that have this cost and this split.
void ForEachShown(const SourceChart& chart, const Cost& cost, size_t split,
                  const std::function<void(const ChartPoint&, double)>& visit) {
  for (const ChartPoint& point : chart.points) {
    const std::optional<double> x = point.splits[split] ? cost.of(point) : std::nullopt;
    if (x) {
      visit(point, *x);
    }
  }
}

// The ends of the axis of errors: one for all splits, so that they can be compared. What lies beyond half the
// RMS of the samples leaves no picture, and would flatten the rest.
void SetErrorRange(const SourceChart& chart, const Metric& metric, PlotAxis& axis) {
  constexpr double kMostOfRms = 0.5;
  double least = std::numeric_limits<double>::infinity();
  double most = 0.0;
  for (const ChartPoint& point : chart.points) {
    for (const auto& split : point.splits) {
      for (size_t limit = 0; split && limit < kNumAngleLimits; ++limit) {
        const LimitFigures& figures = (*split)[limit];
        const bool is_lost = figures.squares.rmse() > kMostOfRms * figures.squares.reference_rms();
        if (figures.num_pairs > 0 && !is_lost && metric.of(figures) > 0.0) {
          least = std::min(least, metric.of(figures));
          most = std::max(most, metric.of(figures));
        }
      }
    }
  }
  if (least <= most) {
    axis.from = least;
    axis.to = most;
  }
}

std::string Capitalised(std::string text) {
  text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return text;
}

std::string ErrorPlot(const SourceChart& chart, const Cost& cost, const Metric& metric, size_t split) {
  Plot plot{.title = Capitalised(SplitName(kSplits[split])),
            .x = {.label = cost.axis, .unit = cost.unit},
            .y = {.label = metric.axis}};
  SetErrorRange(chart, metric, plot.y);
  ForEachShown(chart, cost, split, [&](const ChartPoint& point, double x) {
    if (plot.series.empty() || plot.series.back().name != point.method) {
      const Look look = LookOf(point.method);
      plot.series.push_back({point.method, look.colour, look.marker, {}});
    }
    plot.series.back().points.push_back({x, metric.of((*point.splits[split])[kAllAngles]), point.setting});
  });
  return SvgOf(plot);
}

std::string AnglePlot(const SourceChart& chart, const CropGroup& group, size_t split) {
  Plot plot{.title = Capitalised(SplitName(kSplits[split])),
            .x = {.label = "polar angles of view and light up to, degrees; 90: all",
                  .scale = AxisScale::kLinear,
                  .ticks = {kAngleLimitsDeg.begin(), kAngleLimitsDeg.end()}},
            .y = {.label = kMetrics[0].axis},
            .front = FrontUse::kNone};
  SetErrorRange(chart, kMetrics[0], plot.y);
  for (const size_t index : group.points) {
    const ChartPoint& point = chart.points[index];
    if (!point.splits[split]) {
      continue;
    }
    const Look look = LookOf(point.method);
    PlotSeries series{absl::StrCat(point.method, " ", point.setting), look.colour, look.marker, {}};
    for (size_t limit = 0; limit < kNumAngleLimits; ++limit) {
      const LimitFigures& figures = (*point.splits[split])[limit];
      if (figures.num_pairs > 0) {
        series.points.push_back({kAngleLimitsDeg[limit], figures.squares.rmse(),
                                 absl::StrCat("up to ", kAngleLimitNames[limit])});
      }
    }
    plot.series.push_back(std::move(series));
  }
  return SvgOf(plot);
}

std::string LegendOf(const SourceChart& chart) {
  std::string html = "<div class=\"legend\">";
  std::string previous;
  for (const ChartPoint& point : chart.points) {
    if (point.method != previous) {
      const Look look = LookOf(point.method);
      absl::StrAppend(&html, "<span>", SvgOfMarker(look.colour, look.marker), HtmlEscaped(point.method),
                      "</span>");
      previous = point.method;
    }
  }
  html +=
      "<span><svg xmlns=\"http://www.w3.org/2000/svg\" width=\"30\" height=\"16\"><path d=\"M1 8H29\" "
      "stroke=\"#1f2328\" stroke-opacity=\".28\" stroke-width=\"5\"/><circle cx=\"15\" cy=\"8\" r=\"7\" "
      "fill=\"none\" "
      "stroke=\"#1f2328\"/></svg>Pareto front: nothing else is better in both</span></div>\n";
  return html;
}

std::string Plots(const SourceChart& chart, size_t source) {
  std::string html = "<div class=\"tabs\">\n";
  for (size_t m = 0; m < kMetrics.size(); ++m) {
    const std::string id = absl::StrCat("s", source, "m", m);
    absl::StrAppend(&html, "<input type=\"radio\" name=\"s", source, "\" id=\"", id, "\"",
                    m == 0 ? " checked=\"checked\"" : "", "/><label for=\"", id, "\">", kMetrics[m].name,
                    "</label>\n");
  }
  for (const Metric& metric : kMetrics) {
    html += "<div class=\"panel\">\n";
    html += LegendOf(chart);
    for (const Cost& cost : kCosts) {
      absl::StrAppend(&html, "<h3>", metric.name, " against ", cost.name, "</h3>\n<div class=\"plots\">\n");
      for (size_t split = 0; split < kSplits.size(); ++split) {
        html += ErrorPlot(chart, cost, metric, split);
      }
      html += "</div>\n";
    }
    html += "</div>\n";
  }
  return html + "</div>\n";
}

std::string Fronts(const SourceChart& chart) {
  std::string html = "<h3>On the front of RMSE</h3>\n<table class=\"front\"><thead><tr><th>against</th>";
  for (const Split split : kSplits) {
    absl::StrAppend(&html, "<th>", Capitalised(SplitName(split)), "</th>");
  }
  html += "</tr></thead><tbody>\n";
  for (const Cost& cost : kCosts) {
    absl::StrAppend(&html, "<tr><td><b>", cost.name, "</b></td>");
    for (size_t split = 0; split < kSplits.size(); ++split) {
      std::vector<TwoCosts> costs;
      std::vector<const ChartPoint*> points;
      ForEachShown(chart, cost, split, [&](const ChartPoint& point, double x) {
        costs.push_back({x, (*point.splits[split])[kAllAngles].squares.rmse()});
        points.push_back(&point);
      });
      const std::vector<bool> front = ParetoFront(costs);
      std::vector<size_t> members;
      for (size_t i = 0; i < points.size(); ++i) {
        if (front[i]) {
          members.push_back(i);
        }
      }
      std::ranges::sort(members, {}, [&](size_t i) { return costs[i].x; });
      html += "<td>";
      for (const size_t i : members) {
        absl::StrAppendFormat(
            &html, "<i class=\"swatch\" style=\"background:%s\"></i>%s %s: %s, %.4f<br/>",
            LookOf(points[i]->method).colour, HtmlEscaped(points[i]->method), HtmlEscaped(points[i]->setting),
            cost.unit == AxisUnit::kBytes ? MegabytesText(costs[i].x) : absl::StrFormat("%.3g", costs[i].x),
            costs[i].y);
      }
      html += "</td>";
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table>\n";
}

std::string FullTable(const SourceChart& chart) {
  std::string html =
      "<details><summary>Every setting</summary><div class=\"wide\"><table><thead><tr><th>method</th>"
      "<th>setting</th>";
  for (const char* const column : {"MB", "% of raw", "encode s", "encode CPU s", "stream ns/texel",
                                   "random us", "GL nearest ms", "GL bilinear ms", "GL prepare ms"}) {
    absl::StrAppend(&html, "<th class=\"figure\">", column, "</th>");
  }
  for (const Split split : kSplits) {
    for (const char* const metric : {"RMSE", "relative", "PSNR dB", "DSSIM", "FLIP"}) {
      absl::StrAppend(&html, "<th class=\"figure\">", metric, ", ", SplitName(split), "</th>");
    }
  }
  html += "</tr></thead><tbody>\n";
  for (const ChartPoint& point : chart.points) {
    absl::StrAppend(&html, "<tr><td class=\"method\">", HtmlEscaped(point.method),
                    "</td><td class=\"method\">", HtmlEscaped(point.setting), "</td>");
    const auto figure = [&](const std::string& text) {
      absl::StrAppend(&html, "<td class=\"figure\">", text, "</td>");
    };
    if (!point.splits[0]) {
      absl::StrAppend(&html, "<td colspan=\"24\">", HtmlEscaped(point.refusal), "</td></tr>\n");
      continue;
    }
    const double bytes = static_cast<double>(point.size_bytes);
    figure(absl::StrFormat("%.3f", 1e-6 * bytes));
    figure(absl::StrFormat("%.3f", 100.0 * bytes / static_cast<double>(chart.RawBytes())));
    figure(absl::StrFormat("%.2f", point.encode_s));
    figure(absl::StrFormat("%.2f", point.encode_cpu_s));
    figure(absl::StrFormat("%.1f", 1e9 * point.cpu.streaming_s));
    figure(absl::StrFormat("%.2f", 1e6 * point.cpu.random_s));
    for (double GlFrameCost::*member :
         {&GlFrameCost::nearest_s, &GlFrameCost::bilinear_s, &GlFrameCost::prepare_s}) {
      figure(point.gl ? absl::StrFormat("%.0f", 1e3 * (*point.gl).*member) : "");
    }
    for (const auto& split : point.splits) {
      if (!split) {
        absl::StrAppend(&html, "<td colspan=\"5\">", HtmlEscaped(point.refusal), "</td>");
        continue;
      }
      const LimitFigures& all = (*split)[kAllAngles];
      figure(absl::StrFormat("%.4f", all.squares.rmse()));
      figure(absl::StrFormat("%.4f", all.squares.relative_rmse()));
      figure(absl::StrFormat("%.2f", all.squares.psnr_db()));
      figure(absl::StrFormat("%.4f", all.dssim));
      figure(absl::StrFormat("%.4f", all.flip));
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div></details>\n";
}

absl::StatusOr<std::string> SourceSection(const SourceChart& chart, size_t source) {
  std::string html = absl::StrCat("<h2>", HtmlEscaped(chart.name), "</h2>\n<p class=\"facts\">",
                                  HtmlEscaped(FactsOf(chart)), "</p>\n", FindingsList(chart));
  html += Plots(chart, source);
  html += Fronts(chart);
  if (!chart.groups.empty()) {
    absl::StrAppend(&html, "<h3>RMSE by grazing angle, ", HtmlEscaped(chart.groups[0].title),
                    "</h3>\n<div class=\"plots\">\n");
    for (size_t split = 0; split < kSplits.size(); ++split) {
      html += AnglePlot(chart, chart.groups[0], split);
    }
    html += "</div>\n";
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string crops, CropsHtml(chart));
  html += crops;
  html += FullTable(chart);
  return html;
}

}  // namespace

absl::StatusOr<std::string> CodecsHtml(const std::vector<SourceChart>& charts,
                                       const std::vector<PaperRow>& paper) {
  std::string body = absl::StrCat("<h1>", kTitle,
                                  "</h1>\n<p class=\"lead\">What each codec makes of a BTF: how many bytes "
                                  "it takes, how long it takes to decode, "
                                  "and how far the decoded images are from the measured ones, at directions "
                                  "that the codec was given and at whole "
                                  "lights and whole views that were held out of it. Beside them what one "
                                  "would do otherwise: every image as a JPEG "
                                  "file.</p>\n");
  for (size_t i = 0; i < charts.size(); ++i) {
    TESSERA_ASSIGN_OR_RETURN(const std::string section, SourceSection(charts[i], i));
    body += section;
  }
  if (!paper.empty()) {
    body += PaperHtml(paper);
  }
  body += MethodHtml(charts);
  return HtmlPage(kTitle, absl::StrCat(kChartStyle, kStyle), body);
}

}  // namespace tessera
