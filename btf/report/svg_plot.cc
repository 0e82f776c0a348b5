#include "btf/report/svg_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/report/page.h"
#include "btf/report/pareto.h"

namespace tessera {
namespace {

constexpr double kLeft = 62.0;
constexpr double kRight = 14.0;
constexpr double kTop = 30.0;
constexpr double kBottom = 46.0;
constexpr double kMarkerSize = 4.2;

struct Range {
  double least = std::numeric_limits<double>::infinity();
  double most = -std::numeric_limits<double>::infinity();
};

// Values of an axis to places between 0 and 1.
class Scale {
 public:
  Scale(const PlotAxis& axis, Range range) : axis_(axis) {
    if (!(range.least <= range.most)) {
      range = {1.0, 10.0};
    }
    range.least = axis.from.value_or(range.least);
    range.most = std::max(axis.to.value_or(range.most), range.least);
    if (axis.scale == AxisScale::kLog) {
      constexpr double kMargin = 1.18;  // of the range's ends
      low_ = std::log10(range.least / kMargin);
      high_ = std::log10(range.most * kMargin);
    } else {
      const double margin = 0.06 * std::max(range.most - range.least, 1e-9);
      low_ = range.least - margin;
      high_ = range.most + margin;
    }
  }

  [[nodiscard]] double Place(double value) const {
    const double v = axis_.scale == AxisScale::kLog ? std::log10(value) : value;
    return (v - low_) / (high_ - low_);
  }

  struct Tick {
    double value = 0.0;
    bool is_labelled = false;
  };
  [[nodiscard]] std::vector<Tick> Ticks() const {
    std::vector<Tick> ticks;
    if (!axis_.ticks.empty()) {
      for (const double value : axis_.ticks) {
        ticks.push_back({value, true});
      }
    } else if (axis_.scale == AxisScale::kLog) {
      const double decades = high_ - low_;
      for (int decade = static_cast<int>(std::floor(low_)); decade <= static_cast<int>(high_); ++decade) {
        for (int digit = 1; digit < 10; ++digit) {
          const double value = digit * std::pow(10.0, decade);
          const bool is_labelled = digit == 1 || (decades < 2.5 && (digit == 2 || digit == 5)) ||
                                   (decades < 0.8 && (digit == 3 || digit == 4 || digit == 7));
          ticks.push_back({value, is_labelled});
        }
      }
    } else {
      const double raw = (high_ - low_) / 5.0;
      const double power = std::pow(10.0, std::floor(std::log10(raw)));
      const double step = raw / power < 1.5 ? power : raw / power < 3.5 ? 2.0 * power : 5.0 * power;
      // The sum makes 0 of -0.
      for (double value = std::ceil(low_ / step) * step + 0.0; value <= high_; value += step) {
        ticks.push_back({value, true});
      }
    }
    std::erase_if(ticks, [&](const Tick& tick) {
      const double place = Place(tick.value);
      return place < 0.0 || place > 1.0;
    });
    return ticks;
  }

 private:
  const PlotAxis& axis_;
  double low_ = 0.0;
  double high_ = 1.0;
};

std::string TickText(double value, AxisUnit unit) {
  if (unit == AxisUnit::kNumber) {
    return absl::StrFormat("%.10g", value);
  }
  constexpr std::array kUnits = {"B", "kB", "MB", "GB", "TB"};
  size_t i = 0;
  while (value >= 999.5 && i + 1 < kUnits.size()) {
    value /= 1000.0;
    ++i;
  }
  return absl::StrFormat("%.3g %s", value, kUnits[i]);
}

std::string MarkerShape(Marker marker, double x, double y, double r) {
  switch (marker) {
    case Marker::kCircle:
      return absl::StrFormat("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"%.1f\"", x, y, r);
    case Marker::kSquare:
      return absl::StrFormat("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"", x - 0.9 * r,
                             y - 0.9 * r, 1.8 * r, 1.8 * r);
    case Marker::kTriangle:
      return absl::StrFormat("<path d=\"M%.1f %.1fl%.1f %.1fh%.1fz\"", x, y - 1.2 * r, 1.1 * r, 2.0 * r,
                             -2.2 * r);
    case Marker::kDiamond:
      return absl::StrFormat("<path d=\"M%.1f %.1fl%.1f %.1fl%.1f %.1fl%.1f %.1fz\"", x, y - 1.3 * r, 1.3 * r,
                             1.3 * r, -1.3 * r, 1.3 * r, -1.3 * r, -1.3 * r);
    case Marker::kCross:
      return absl::StrFormat("<path d=\"M%.1f %.1fl%.1f %.1fm0 %.1fl%.1f %.1f\" class=\"open\"", x - r, y - r,
                             2 * r, 2 * r, -2 * r, -2 * r, 2 * r);
    case Marker::kPlus:
      return absl::StrFormat("<path d=\"M%.1f %.1fh%.1fm%.1f %.1fv%.1f\" class=\"open\"", x - 1.2 * r, y,
                             2.4 * r, -1.2 * r, -1.2 * r, 2.4 * r);
  }
  return "";
}

std::string Style(Marker marker, const std::string& colour) {
  return marker == Marker::kCross || marker == Marker::kPlus
             ? absl::StrCat(" fill=\"none\" stroke-width=\"2.2\" stroke=\"", colour, "\"")
             : absl::StrCat(" stroke=\"#fff\" stroke-width=\"0.8\" fill=\"", colour, "\"");
}

bool IsShown(const Plot& plot, const PlotPoint& point) {
  const auto fits = [](const PlotAxis& axis, double value) {
    return std::isfinite(value) && (axis.scale == AxisScale::kLinear || value > 0.0);
  };
  return fits(plot.x, point.x) && fits(plot.y, point.y);
}

// One picture in the making: the frame's pixels.
class Drawing {
 public:
  explicit Drawing(const Plot& plot)
      : plot_(plot),
        x_(plot.x, RangeOf(plot, [](const PlotPoint& p) { return p.x; })),
        y_(plot.y, RangeOf(plot, [](const PlotPoint& p) { return p.y; })) {
    std::vector<TwoCosts> costs;
    for (const PlotSeries& series : plot.series) {
      for (const PlotPoint& point : series.points) {
        costs.push_back(IsShown(plot, point) ? TwoCosts{point.x, point.y}
                                             : TwoCosts{std::numeric_limits<double>::quiet_NaN(), 0.0});
      }
    }
    front_ = plot.front == FrontUse::kDraw ? ParetoFront(costs) : std::vector<bool>(costs.size(), false);
  }

  std::string Draw() {
    svg_ = absl::StrFormat(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"plot\" width=\"%d\" height=\"%d\" viewBox=\"0 0 "
        "%d %d\" "
        "role=\"img\" font-size=\"11\">\n<text x=\"%.0f\" y=\"17\" font-size=\"13\" font-weight=\"600\" "
        "fill=\"#1f2328\">%s</text>\n",
        plot_.width, plot_.height, plot_.width, plot_.height, kLeft, HtmlEscaped(plot_.title));
    DrawAxes();
    DrawFront();
    DrawSeries();
    DrawLabels();
    svg_ += "</svg>\n";
    return svg_;
  }

 private:
  template <typename ValueOf>
  static Range RangeOf(const Plot& plot, ValueOf value_of) {
    Range range;
    for (const PlotSeries& series : plot.series) {
      for (const PlotPoint& point : series.points) {
        if (IsShown(plot, point)) {
          range.least = std::min(range.least, value_of(point));
          range.most = std::max(range.most, value_of(point));
        }
      }
    }
    return range;
  }

  [[nodiscard]] double Right() const { return plot_.width - kRight; }
  [[nodiscard]] double Bottom() const { return plot_.height - kBottom; }
  [[nodiscard]] double PixelX(double value) const {
    return kLeft + std::clamp(x_.Place(value), 0.0, 1.0) * (Right() - kLeft);
  }
  [[nodiscard]] double PixelY(double value) const {
    return Bottom() - std::clamp(y_.Place(value), 0.0, 1.0) * (Bottom() - kTop);
  }
  [[nodiscard]] bool IsBeyond(const PlotPoint& point) const {
    return x_.Place(point.x) > 1.0 || y_.Place(point.y) > 1.0;
  }

  void Line(double x1, double y1, double x2, double y2, const char* colour) {
    absl::StrAppendFormat(&svg_, "<path d=\"M%.1f %.1fL%.1f %.1f\" stroke=\"%s\" fill=\"none\"/>", x1, y1, x2,
                          y2, colour);
  }

  void DrawAxes() {
    for (const Scale::Tick& tick : x_.Ticks()) {
      const double x = PixelX(tick.value);
      Line(x, kTop, x, Bottom(), tick.is_labelled ? "#e2e5e9" : "#f3f4f6");
      if (tick.is_labelled) {
        absl::StrAppendFormat(&svg_,
                              "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\" fill=\"#57606a\">%s</text>",
                              x, Bottom() + 15.0, TickText(tick.value, plot_.x.unit));
      }
    }
    for (const Scale::Tick& tick : y_.Ticks()) {
      const double y = PixelY(tick.value);
      Line(kLeft, y, Right(), y, tick.is_labelled ? "#e2e5e9" : "#f3f4f6");
      if (tick.is_labelled) {
        absl::StrAppendFormat(&svg_,
                              "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\" fill=\"#57606a\">%s</text>",
                              kLeft - 6.0, y + 4.0, TickText(tick.value, plot_.y.unit));
      }
    }
    absl::StrAppendFormat(&svg_,
                          "\n<path d=\"M%.1f %.1fV%.1fH%.1f\" stroke=\"#57606a\" fill=\"none\"/>\n"
                          "<text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\" fill=\"#1f2328\">%s</text>"
                          "<text transform=\"translate(14 %.1f) rotate(-90)\" text-anchor=\"middle\" "
                          "fill=\"#1f2328\">%s</text>\n",
                          kLeft, kTop, Bottom(), Right(), 0.5 * (kLeft + Right()), plot_.height - 10,
                          HtmlEscaped(plot_.x.label), 0.5 * (kTop + Bottom()), HtmlEscaped(plot_.y.label));
  }

  // Steps: what is reached at each cost.
  void DrawFront() {
    std::vector<const PlotPoint*> points;
    ForEachPoint([&](const PlotSeries&, const PlotPoint& point, bool is_front) {
      if (is_front) {
        points.push_back(&point);
      }
    });
    if (points.empty()) {
      return;
    }
    std::ranges::sort(points, {}, [](const PlotPoint* p) { return p->x; });
    std::string path = absl::StrFormat("M%.1f %.1f", PixelX(points[0]->x), kTop);
    for (const PlotPoint* point : points) {
      absl::StrAppendFormat(&path, "H%.1fV%.1f", PixelX(point->x), PixelY(point->y));
    }
    absl::StrAppendFormat(&svg_,
                          "<path d=\"%sH%.1f\" fill=\"none\" stroke=\"#1f2328\" stroke-opacity=\"0.28\" "
                          "stroke-width=\"5\" stroke-linejoin=\"round\"/>\n",
                          path, Right());
  }

  void DrawSeries() {
    for (const PlotSeries& series : plot_.series) {
      std::string path;
      for (const PlotPoint& point : series.points) {
        if (IsShown(plot_, point)) {
          absl::StrAppendFormat(&path, "%s%.1f %.1f", path.empty() ? "M" : "L", PixelX(point.x),
                                PixelY(point.y));
        }
      }
      absl::StrAppendFormat(&svg_, "<path d=\"%s\" fill=\"none\" stroke=\"%s\" stroke-width=\"1.4\"/>",
                            path.empty() ? "M0 0" : path, series.colour);
    }
    svg_ += '\n';
    ForEachPoint([&](const PlotSeries& series, const PlotPoint& point, bool is_front) {
      const double x = PixelX(point.x);
      const double y = PixelY(point.y);
      svg_ += "<g>";
      if (is_front) {
        absl::StrAppendFormat(
            &svg_, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"7.5\" fill=\"none\" stroke=\"#1f2328\"/>", x, y);
      }
      const bool is_beyond = IsBeyond(point);
      const Marker marker = is_beyond ? Marker::kTriangle : series.marker;
      absl::StrAppend(&svg_, MarkerShape(marker, x, y, kMarkerSize),
                      is_beyond
                          ? absl::StrCat(" fill=\"#fff\" stroke-width=\"1.5\" stroke=\"", series.colour, "\"")
                          : Style(marker, series.colour),
                      "/>");
      absl::StrAppendFormat(&svg_, "<title>%s %s: %s, %.4g%s%s</title></g>\n", HtmlEscaped(series.name),
                            HtmlEscaped(point.label), TickText(point.x, plot_.x.unit), point.y,
                            is_front ? ", on the front" : "", is_beyond ? ", beyond the edge" : "");
    });
  }

  // Of points on the front, where there is room.
  void DrawLabels() {
    struct Box {
      double x1, y1, x2, y2;
    };
    std::vector<Box> taken;
    ForEachPoint([&](const PlotSeries&, const PlotPoint& point, bool) {
      const double r = kMarkerSize;
      taken.push_back({PixelX(point.x) - r, PixelY(point.y) - r, PixelX(point.x) + r, PixelY(point.y) + r});
    });
    ForEachPoint([&](const PlotSeries& series, const PlotPoint& point, bool is_front) {
      if (!is_front) {
        return;
      }
      const double width = 6.2 * static_cast<double>(point.label.size());
      const double x = PixelX(point.x);
      const double y = PixelY(point.y);
      const std::array<Box, 4> places = {{{x - 10.0 - width, y + 4.0, x - 10.0, y + 15.0},
                                          {x + 9.0, y - 15.0, x + 9.0 + width, y - 4.0},
                                          {x - 0.5 * width, y + 10.0, x + 0.5 * width, y + 21.0},
                                          {x - 10.0 - width, y - 15.0, x - 10.0, y - 4.0}}};
      for (const Box& box : places) {
        const bool fits = box.x1 > kLeft && box.x2 < Right() && box.y1 > kTop && box.y2 < Bottom();
        if (fits && std::ranges::none_of(taken, [&](const Box& other) {
              return box.x1 < other.x2 && box.x2 > other.x1 && box.y1 < other.y2 && box.y2 > other.y1;
            })) {
          taken.push_back(box);
          absl::StrAppendFormat(&svg_,
                                "<text x=\"%.1f\" y=\"%.1f\" fill=\"%s\" stroke=\"#fff\" stroke-width=\"3\" "
                                "paint-order=\"stroke\">%s</text>",
                                box.x1, box.y2 - 2.0, series.colour, HtmlEscaped(point.label));
          return;
        }
      }
    });
  }

  template <typename Visit>
  void ForEachPoint(Visit visit) const {
    size_t index = 0;
    for (const PlotSeries& series : plot_.series) {
      for (const PlotPoint& point : series.points) {
        const bool is_front = front_[index++];
        if (IsShown(plot_, point)) {
          visit(series, point, is_front);
        }
      }
    }
  }

  const Plot& plot_;
  Scale x_;
  Scale y_;
  std::vector<bool> front_;  // of all points, series after series
  std::string svg_;
};

}  // namespace

std::string SvgOf(const Plot& plot) {
  return Drawing(plot).Draw();
}

std::string SvgOfMarker(const std::string& colour, Marker marker) {
  return absl::StrCat(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"26\" height=\"14\"><path d=\"M1 7H25\" stroke=\"",
      colour, "\" stroke-width=\"1.4\"/>", MarkerShape(marker, 13.0, 7.0, 4.6), Style(marker, colour),
      "/></svg>");
}

}  // namespace tessera
