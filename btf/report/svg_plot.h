// A scatter plot as inline SVG: series of marked points joined by lines, and the front that no point beats.
//
//   Plot plot{.title = "held-out lights", .x = {"bytes", AxisUnit::kBytes}, .y = {"RMSE"}};
//   plot.series.push_back({"dfmf", "#d55e00", Marker::kCircle, {{2.4e6, 0.012, "rank 48"}}});
//   html += SvgOf(plot);
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace tessera {

enum class Marker { kCircle, kSquare, kTriangle, kDiamond, kCross, kPlus };
enum class AxisUnit { kNumber, kBytes };  // kBytes: ticks in kB, MB, GB of powers of 1000
enum class AxisScale { kLog, kLinear };

struct PlotAxis {
  std::string label;  // with its unit
  AxisUnit unit = AxisUnit::kNumber;
  AxisScale scale = AxisScale::kLog;
  // Where the axis begins and ends; absent: at the points. Points beyond the end are drawn there, as arrows.
  std::optional<double> from;
  std::optional<double> to;
  // Values marked on the axis; empty: round ones.
  std::vector<double> ticks;
};

struct PlotPoint {
  double x = 0.0;
  double y = 0.0;
  std::string label;  // shown beside points on the front, and in every point's tooltip
};

struct PlotSeries {
  std::string name;
  std::string colour;
  Marker marker = Marker::kCircle;
  std::vector<PlotPoint> points;
};

enum class FrontUse { kDraw, kNone };

struct Plot {
  std::string title;
  PlotAxis x;
  PlotAxis y;
  std::vector<PlotSeries> series;
  FrontUse front = FrontUse::kDraw;
  int width = 430;
  int height = 340;
};

// Points that a logarithmic axis cannot show (not above 0) or that are not finite are left out.
[[nodiscard]] std::string SvgOf(const Plot& plot);

// An SVG of the marker alone, for legends.
[[nodiscard]] std::string SvgOfMarker(const std::string& colour, Marker marker);

}  // namespace tessera
