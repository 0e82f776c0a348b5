#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/status_macros.h"
#include "btf/chart/page_style.h"
#include "btf/chart/synthesis_chart.h"
#include "btf/report/page.h"
#include "btf/report/svg_plot.h"

namespace tessera {
namespace {

constexpr char kSynthesisTitle[] = "Tile synthesis: seams, speed, repetition";
constexpr char kSynthesisStyle[] = R"(
.sheets { display: flex; flex-wrap: wrap; gap: 12px; }
.sheets figure { margin: 0; width: 600px; }
.sheets img { width: 600px; image-rendering: pixelated; display: block; }
)";

struct MethodLook {
  const char* colour;
  Marker marker;
};

// Of kChartedMethods, in their order: colours that are told apart by everyone (Okabe and Ito).
constexpr std::array<MethodLook, kChartedMethods.size()> kMethodLooks = {{{"#cc79a7", Marker::kDiamond},
                                                                          {"#d55e00", Marker::kPlus},
                                                                          {"#56b4e9", Marker::kSquare},
                                                                          {"#0072b2", Marker::kCircle}}};

using ValueOf = std::function<double(const SynthesisPoint&)>;

// The points of a method that differ from its common setting in `member` and seed alone, in order of it: the
// mean over seeds of each.
template <typename Value>
std::vector<SynthesisPoint> Varied(const SynthesisChart& chart, size_t method,
                                   Value SynthesisSetting::*member) {
  constexpr std::array kFigures = {&SynthesisPoint::seconds,       &SynthesisPoint::borders_ratio,
                                   &SynthesisPoint::insides_ratio, &SynthesisPoint::seen_ratio,
                                   &SynthesisPoint::seen_error,    &SynthesisPoint::full_error,
                                   &SynthesisPoint::repetition};
  std::map<Value, std::vector<const SynthesisPoint*>> by_value;
  for (const SynthesisPoint& point : chart.points) {
    SynthesisSetting common = chart.common(method);
    common.seed = point.setting.seed;
    common.*member = point.setting.*member;
    if (point.method == method && point.setting == common) {
      by_value[point.setting.*member].push_back(&point);
    }
  }
  std::vector<SynthesisPoint> varied;
  for (const auto& [value, points] : by_value) {
    SynthesisPoint& mean = varied.emplace_back(*points.front());
    for (const auto figure : kFigures) {
      mean.*figure = 0.0;
      for (const SynthesisPoint* const point : points) {
        mean.*figure += point->*figure / static_cast<double>(points.size());
      }
    }
  }
  return varied;
}

// Whether the points of a method are joined in a plot.
enum class Joined { kYes, kNo };

struct Axes {
  std::string title;
  PlotAxis x;
  PlotAxis y;
  Joined joined = Joined::kYes;
};

template <typename Value>
std::string PlotOf(const SynthesisChart& chart, const Axes& axes, Value SynthesisSetting::*member,
                   const ValueOf& x_of, const ValueOf& y_of) {
  Plot plot{.title = axes.title, .x = axes.x, .y = axes.y, .series = {}, .front = FrontUse::kNone};
  for (size_t method = 0; method < kChartedMethods.size(); ++method) {
    const MethodLook& look = kMethodLooks[method];
    PlotSeries series{kChartedMethods[method].name, look.colour, look.marker, {}};
    for (const SynthesisPoint& point : Varied(chart, method, member)) {
      series.points.push_back({x_of(point), y_of(point), ""});
      if (axes.joined == Joined::kNo) {
        plot.series.push_back(series);
        series.points.clear();
      }
    }
    plot.series.push_back(std::move(series));
  }
  return SvgOf(plot);
}

double Insides(const SynthesisPoint& point) {
  return point.insides_ratio;
}
double Borders(const SynthesisPoint& point) {
  return point.borders_ratio;
}
double Dims(const SynthesisPoint& point) {
  return point.setting.dims;
}

std::vector<double> TicksOf(const SynthesisChart& chart, const ValueOf& value_of) {
  std::vector<double> ticks;
  for (const SynthesisPoint& point : chart.points) {
    ticks.push_back(value_of(point));
  }
  std::ranges::sort(ticks);
  ticks.erase(std::unique(ticks.begin(), ticks.end()), ticks.end());
  return ticks;
}

std::string SynthesisPlots(const SynthesisChart& chart) {
  const auto linear = [](const std::string& label, std::optional<double> from) {
    return PlotAxis{.label = label, .scale = AxisScale::kLinear, .from = from};
  };
  const PlotAxis insides = linear("R within tiles", 0.9);
  const PlotAxis borders = linear("R across borders (diamonds: ends of sides alone)", 0.9);
  const PlotAxis seconds{.label = "seconds, without the certificate"};
  PlotAxis dims{.label = "coefficient layers: dimensions that cuts see"};
  dims.ticks = TicksOf(chart, Dims);
  const auto seconds_of = [](const SynthesisPoint& p) { return p.seconds; };
  const auto candidates_of = [](const SynthesisPoint& p) {
    return static_cast<double>(p.setting.candidates);
  };
  const auto strip_of = [](const SynthesisPoint& p) { return static_cast<double>(p.setting.strip_height); };
  const auto repetition_of = [](const SynthesisPoint& p) { return p.repetition; };
  PlotAxis strips = linear("strip height, texels; of diamonds: overlap", std::nullopt);
  strips.ticks = TicksOf(chart, strip_of);
  const PlotAxis candidates{.label = "sets of samples drawn; patches cut for a window"};
  const auto seen_ratio_of = [](const SynthesisPoint& p) { return p.seen_ratio; };
  const auto seen_of = [](const SynthesisPoint& p) { return p.seen_error; };
  const auto full_of = [](const SynthesisPoint& p) { return p.full_error; };
  using S = SynthesisSetting;
  const auto row = [](const char* heading, const std::vector<std::string>& plots) {
    std::string html = absl::StrCat("<h3>", heading, "</h3>\n<div class=\"plots\">\n");
    for (const std::string& plot : plots) {
      html += plot;
    }
    return html + "</div>\n";
  };
  const std::string full_axis = absl::StrCat("mismatch of seams in all ", chart.embedding_dims, " layers");
  return absl::StrCat(
      row("Seams against time, one point a seed or number of candidates",
          {PlotOf(chart, {"Within tiles, seeds", seconds, insides, Joined::kNo}, &S::seed, seconds_of,
                  Insides),
           PlotOf(chart, {"Across borders, seeds", seconds, borders, Joined::kNo}, &S::seed, seconds_of,
                  Borders),
           PlotOf(chart, {"Within tiles, candidates", seconds, insides}, &S::candidates, seconds_of,
                  Insides)}),
      row("Seam error against the number of coefficient layers: R, 1 where a seam cannot be told from the "
          "material",
          {PlotOf(chart, {"In the layers that cuts see", dims, linear("R of steps in those layers", 0.8)},
                  &S::dims, Dims, seen_ratio_of),
           PlotOf(chart, {"In reflectance, within tiles", dims, insides}, &S::dims, Dims, Insides),
           PlotOf(chart, {"In reflectance, across borders", dims, borders}, &S::dims, Dims, Borders)}),
      row("Mismatch of the two patches at a seam against the layers: 1 for texels drawn at random",
          {PlotOf(chart,
                  {"In the layers that cuts see", dims, linear("mismatch of seams in those layers", 0.0)},
                  &S::dims, Dims, seen_of),
           PlotOf(chart, {"In all layers", dims, linear(full_axis, 0.0)}, &S::dims, Dims, full_of)}),
      row("Strip height",
          {PlotOf(chart, {"Within tiles", strips, insides}, &S::strip_height, strip_of, Insides),
           PlotOf(chart, {"Across borders", strips, borders}, &S::strip_height, strip_of, Borders),
           PlotOf(chart, {"Time", strips, PlotAxis{.label = "seconds"}}, &S::strip_height, strip_of,
                  seconds_of)}),
      row("Candidates",
          {PlotOf(chart, {"Within tiles", candidates, insides}, &S::candidates, candidates_of, Insides),
           PlotOf(chart, {"Repetition, the material's own: 1", candidates, linear("repetition", 0.0)},
                  &S::candidates, candidates_of, repetition_of),
           PlotOf(chart, {"Repetition and strip height", strips, linear("repetition", 0.0)}, &S::strip_height,
                  strip_of, repetition_of)}));
}

std::string SynthesisLegend() {
  std::string html = "<div class=\"legend\">";
  for (size_t method = 0; method < kChartedMethods.size(); ++method) {
    absl::StrAppend(&html, "<span>", SvgOfMarker(kMethodLooks[method].colour, kMethodLooks[method].marker),
                    kChartedMethods[method].name, "</span>");
  }
  return html + "</div>\n";
}

std::string SynthesisTable(const SynthesisChart& chart) {
  std::string html =
      "<details><summary>Every setting</summary><div class=\"wide\"><table><thead><tr><th>method</th>";
  for (const char* const column : {"dims", "candidates", "strip", "seed", "seconds", "R borders", "R within",
                                   "p95", "cut %", "R seen", "seen", "full", "repetition", "used %"}) {
    absl::StrAppend(&html, "<th class=\"figure\">", column, "</th>");
  }
  html += "</tr></thead><tbody>\n";
  for (const SynthesisPoint& point : chart.points) {
    absl::StrAppend(&html, "<tr><td>", point.charted().name, "</td>");
    const auto figure = [&](const std::string& text) {
      absl::StrAppend(&html, "<td class=\"figure\">", text, "</td>");
    };
    figure(absl::StrCat(point.setting.dims));
    figure(absl::StrCat(point.setting.candidates));
    figure(absl::StrCat(point.setting.strip_height));
    figure(absl::StrCat(point.setting.seed));
    figure(absl::StrFormat("%.3f", point.seconds));
    figure(absl::StrFormat("%.3f", point.borders_ratio));
    figure(absl::StrFormat("%.3f", point.insides_ratio));
    figure(absl::StrFormat("%.3f", point.insides_ratio_p95));
    figure(absl::StrFormat("%.2f", 100.0 * point.insides_cut_share));
    figure(absl::StrFormat("%.3f", point.seen_ratio));
    figure(absl::StrFormat("%.3f", point.seen_error));
    figure(absl::StrFormat("%.3f", point.full_error));
    figure(absl::StrFormat("%.2f", point.repetition));
    figure(absl::StrFormat("%.1f", 100.0 * point.referenced_share));
    html += "</tr>\n";
  }
  return html + "</tbody></table></div></details>\n";
}

// What the figures say at the common setting, and how far the layers move them.
std::string SynthesisFindings(const SynthesisChart& chart) {
  std::string html = "<ul>\n";
  for (size_t method = 0; method < kChartedMethods.size(); ++method) {
    const auto layers = Varied(chart, method, &SynthesisSetting::dims);
    const auto common = std::ranges::find(layers, chart.common(method), &SynthesisPoint::setting);
    if (common == layers.end()) {
      continue;
    }
    absl::StrAppendFormat(
        &html,
        "<li><b>%s</b>: R %.3f within tiles, %.3f across borders, %.2f s (means of seeds). From %d to %d "
        "layers R of its seams in those layers goes from %.3f to %.3f, R within tiles from %.3f to %.3f, the "
        "mismatch of its seams in those layers from %.3f to %.3f, in all layers from %.3f to %.3f.</li>\n",
        kChartedMethods[method].name, common->insides_ratio, common->borders_ratio, common->seconds,
        layers.front().setting.dims, layers.back().setting.dims, layers.front().seen_ratio,
        layers.back().seen_ratio, layers.front().insides_ratio, layers.back().insides_ratio,
        layers.front().seen_error, layers.back().seen_error, layers.front().full_error,
        layers.back().full_error);
  }
  return html + "</ul>\n";
}

absl::StatusOr<std::string> SheetsHtml(const SynthesisChart& chart) {
  std::string html = "<h3>Tiles, and where their seams show</h3>\n<div class=\"sheets\">\n";
  for (size_t method = 0; method < chart.sheets.size(); ++method) {
    TESSERA_ASSIGN_OR_RETURN(const std::string uri, PngDataUri(chart.sheets[method]));
    absl::StrAppend(&html, "<figure><img alt=\"\" src=\"", uri, "\"/><figcaption>",
                    kChartedMethods[method].name, "</figcaption></figure>\n");
  }
  return html + "</div>\n";
}

std::string SynthesisFacts(const SynthesisChart& chart) {
  std::string text =
      absl::StrFormat("%dx%d texels, tiles of %dx%d in plane-16; both embeddings in %.2f s; ", chart.width,
                      chart.height, chart.tile_size, chart.tile_size, chart.embed_s);
  text += "share of the variance in the first layers:";
  for (size_t dims = 1; dims <= chart.captured.size(); dims *= 2) {
    absl::StrAppendFormat(&text, " %d: %.1f%%%s", dims, 100.0 * chart.captured[dims - 1],
                          2 * dims <= chart.captured.size() ? "," : ".");
  }
  return text;
}

std::string TilesHtml(const std::vector<TilesRow>& rows) {
  std::string html =
      "<h2>Table III of [Leung2007], ours beside it</h2>\n<p class=\"facts\">Tile sets of 96 tiles. The "
      "paper's figures are from a Pentium IV at 3.2 GHz and from BTFs that are not public; ours are from "
      "this "
      "machine, by \"frame\", from the generated material named, of as many texels and coefficients. Seconds "
      "are wall clock without encoding, embedding and certificate; MB are the referenced BTFels, a byte a "
      "coefficient.</p>\n<div class=\"wide\"><table><thead><tr><th>material</th><th>ours</th>";
  for (const char* const column : {"texels", "tiles", "paper min", "ours s", "faster", "paper used %",
                                   "ours used %", "paper MB", "ours MB", "R within"}) {
    absl::StrAppend(&html, "<th class=\"figure\">", column, "</th>");
  }
  html += "</tr></thead><tbody>\n";
  for (const TilesRow& row : rows) {
    absl::StrAppend(&html, "<tr><td>", row.material, "</td><td>", HtmlEscaped(row.source), "</td>");
    const auto figure = [&](const std::string& text) {
      absl::StrAppend(&html, "<td class=\"figure\">", text, "</td>");
    };
    figure(absl::StrFormat("%dx%d", row.side, row.side));
    figure(absl::StrFormat("%dx%d", row.tile_size, row.tile_size));
    figure(absl::StrFormat("%.0f", row.paper_minutes));
    figure(absl::StrFormat("%.1f", row.run.seconds));
    figure(absl::StrFormat("%.0fx", 60.0 * row.paper_minutes / row.run.seconds));
    figure(absl::StrFormat("%.2f", 100.0 * row.paper_share));
    figure(absl::StrFormat("%.2f", 100.0 * row.run.referenced_share));
    figure(absl::StrFormat("%.2f", row.paper_megabytes));
    figure(absl::StrFormat("%.2f", 1e-6 * static_cast<double>(row.run.btfel_bytes)));
    figure(absl::StrFormat("%.3f", row.run.insides_ratio));
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

constexpr char kSynthesisRules[] = R"(<h2>How it was measured</h2>
<ul>
<li><b>diamond-dp, diamond-cut</b>: one sample for every edge colour; a tile joins four halves along its diagonals, by the
cheapest path that never turns back or by a minimum cut, through an overlap as wide as the strip height. Sets of samples are drawn
at random until d is below d_max, here half the mean squared distance of two texels; of the rest the best.</li>
<li><b>frame, mismatch</b>: the paper's method, and its price of a seam. <b>frame, excess</b>: ours, with the price that counts only
what a seam adds to the material's own steps, and an embedding of its own: of pictures from the measured directions, each divided by
the spread of its values, most of them from grazing views.</li>
<li><b>R</b>: the certificate, 256 images spread over views and lights; steps along seams over the material's own there, 1 where a
cut cannot be told from the material. It is a mean over cut pairs: how many there are stands in the table as cut share. Borders of
diamonds are pieces of the exemplar, so that only their ends can have seams. <b>In layers</b> it is the same with distances in the
first principal components of the SH coefficients, the largest first, in place of images.</li>
<li><b>Mismatch of seams</b>: half the sum of |a - b'| and |a' - b| within tiles, over the root mean square distance of two texels
drawn at random, in the same dimensions. Higher layers are rougher, so that it grows for every method. Ours is judged in as many of
them as it takes of its own.</li>
<li><b>Time</b>: wall clock from the embedding to the tiles, spectra of the exemplar included, the certificate not.</li>
<li>One parameter varies, the others stay: 32 layers, 256 draws at most or 16 patches. Points are means over the seeds that the
table has for them: up to three for the common setting and for the layers of diamonds, which depend on a few samples.</li>
</ul>
)";

}  // namespace

absl::StatusOr<std::string> SynthesisHtml(const std::vector<SynthesisChart>& charts,
                                          const std::vector<TilesRow>& paper) {
  std::string body = absl::StrCat("<h1>", kSynthesisTitle,
                                  "</h1>\n<p class=\"lead\">The published ways of making Wang tiles of a BTF "
                                  "and ours: how far their seams show, in the layers that cuts see and in "
                                  "reflectance, how long they take and how much they repeat.</p>\n");
  for (const SynthesisChart& chart : charts) {
    absl::StrAppend(&body, "<h2>", HtmlEscaped(chart.name), "</h2>\n<p class=\"facts\">",
                    SynthesisFacts(chart), "</p>\n", SynthesisFindings(chart), SynthesisLegend(),
                    SynthesisPlots(chart));
    TESSERA_ASSIGN_OR_RETURN(const std::string sheets, SheetsHtml(chart));
    absl::StrAppend(&body, sheets, SynthesisTable(chart));
  }
  if (!paper.empty()) {
    body += TilesHtml(paper);
  }
  return HtmlPage(kSynthesisTitle, absl::StrCat(kChartStyle, kSynthesisStyle),
                  absl::StrCat(body, kSynthesisRules));
}

}  // namespace tessera
