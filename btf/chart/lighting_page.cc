#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/status_macros.h"
#include "btf/chart/lighting_chart.h"
#include "btf/chart/page_style.h"
#include "btf/report/page.h"
#include "btf/report/svg_plot.h"

namespace tessera {
namespace {

constexpr char kLightingTitle[] = "Light from all around: error against time";
constexpr char kLightingStyle[] = R"(
.pictures { display: flex; flex-wrap: wrap; gap: 12px; }
.pictures figure { margin: 0; width: 288px; }
.pictures img { width: 288px; image-rendering: pixelated; display: block; }
)";
constexpr char kLightingRules[] = R"(<h2>How it was measured</h2>
<ul>
<li>A torus wears the middle of the material on each of its faces, coded by "dsh" at its default size; the texels stay the same, only light differs.</li>
<li>Each environment is reduced to the texels named, by solid angle, for all ways alike. The truth is a sum over every one of them in double precision, with rays to each for the shadows.</li>
<li>Error is the root mean square difference over the root mean square of the truth, linear RGB, over pixels that the torus covers whole.</li>
<li>Time is the wall clock of a further picture in GL on the CPU, the quicker of two, of more than 100 lights of one: shading, and shadow maps where there are shadows. Choosing lights and projecting the environment are not in it: they come once an environment.</li>
<li>The frequency domain has no shadows of the mesh on itself; its values are summed before the clamp at zero that ends every decode.</li>
</ul>
)";

struct LightingLook {
  const char* colour;
  Marker marker;
};
// By LightingMethod; colours that are told apart by everyone (Okabe and Ito).
constexpr std::array<LightingLook, kLightingMethodNames.size()> kLightingLooks = {
    {{"#56b4e9", Marker::kSquare}, {"#0072b2", Marker::kCircle}, {"#d55e00", Marker::kDiamond}}};

using ErrorMember = double LightingPoint::*;

std::string LightingPlot(const LightingChart& chart, const LightingEnvironment& environment,
                         const char* title, ErrorMember error) {
  Plot plot{.title = title,
            .x = {.label = "time of a picture over that under one light"},
            .y = {.label = "relative error"},
            .series = {},
            .front = FrontUse::kNone};
  for (size_t method = 0; method < kLightingMethodNames.size(); ++method) {
    PlotSeries series{
        kLightingMethodNames[method], kLightingLooks[method].colour, kLightingLooks[method].marker, {}};
    for (const LightingPoint& point : environment.points) {
      if (static_cast<size_t>(point.method) == method) {
        series.points.push_back({point.seconds / chart.one_light_s, point.*error, absl::StrCat(point.count)});
      }
    }
    plot.series.push_back(std::move(series));
  }
  return SvgOf(plot);
}

std::string LightingLegend() {
  std::string html = "<div class=\"legend\">";
  for (size_t method = 0; method < kLightingMethodNames.size(); ++method) {
    absl::StrAppend(&html, "<span>",
                    SvgOfMarker(kLightingLooks[method].colour, kLightingLooks[method].marker),
                    kLightingMethodNames[method], method == 2 ? ", order" : ", number", "</span>");
  }
  return html + "</div>\n";
}

// The first point of a method, of falling errors, whose error is below `error`; or none.
const LightingPoint* FirstBelow(const LightingEnvironment& environment, LightingMethod method,
                                ErrorMember member, double error) {
  for (const LightingPoint& point : environment.points) {
    if (point.method == method && point.*member < error) {
      return &point;
    }
  }
  return nullptr;
}

const LightingPoint* Best(const LightingEnvironment& environment, LightingMethod method, ErrorMember member) {
  const LightingPoint* best = nullptr;
  for (const LightingPoint& point : environment.points) {
    if (point.method == method && (best == nullptr || point.*member < best->*member)) {
      best = &point;
    }
  }
  return best;
}

std::string LightingFindings(const LightingChart& chart, const LightingEnvironment& environment) {
  std::string html = "<ul>\n";
  const auto by_one = [&](const LightingPoint& point) { return point.seconds / chart.one_light_s; };
  for (const LightingPoint& point : environment.points) {
    if (point.method != LightingMethod::kFrequency) {
      continue;
    }
    const LightingPoint* const lights =
        FirstBelow(environment, LightingMethod::kLights, &LightingPoint::error, point.error);
    absl::StrAppendFormat(&html, "<li>Order %d is off by %.2g%% and takes as long as %.1f lights; ",
                          point.count, 100.0 * point.error, by_one(point));
    if (lights == nullptr) {
      html += "no number of lights charted comes closer.</li>\n";
    } else {
      // The least number charted says nothing of what fewer would do.
      const bool is_least = lights == FirstBelow(environment, LightingMethod::kLights, &LightingPoint::error,
                                                 std::numeric_limits<double>::infinity());
      absl::StrAppendFormat(&html,
                            "%d lights come closer (%.2g%%), in %.2g times its time: <b>%s</b>.</li>\n",
                            lights->count, 100.0 * lights->error, lights->seconds / point.seconds,
                            lights->seconds < point.seconds ? "lights win"
                            : is_least                      ? "slower and closer, fewer are not charted"
                                                            : "the frequency domain wins");
    }
  }
  const LightingPoint* const smooth =
      Best(environment, LightingMethod::kFrequency, &LightingPoint::shadowed_error);
  const LightingPoint* const lights =
      smooth == nullptr ? nullptr
                        : FirstBelow(environment, LightingMethod::kShadowedLights,
                                     &LightingPoint::shadowed_error, smooth->shadowed_error);
  if (lights != nullptr) {
    absl::StrAppendFormat(
        &html,
        "<li>The torus's shadows on itself: a sum over every texel without them is off by "
        "%.2g%%, the frequency domain by %.2g%% at best (order %d); %d lights with shadows come "
        "closer (%.2g%%), in %.2g times its time.</li>\n",
        100.0 * environment.shadow_cost, 100.0 * smooth->shadowed_error, smooth->count, lights->count,
        100.0 * lights->shadowed_error, lights->seconds / smooth->seconds);
  }
  return html + "</ul>\n";
}

// All alike, so that the truth's brightest twentieth is white.
double ExposureOf(const Image& truth) {
  std::vector<float> values;
  for (size_t i = 0; i < truth.pixels.size(); ++i) {
    if (i % 4 != 3 && truth.pixels[i / 4 * 4 + 3] > 0.0F) {
      values.push_back(truth.pixels[i]);
    }
  }
  if (values.empty()) {
    return 1.0;
  }
  const auto nth = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 19 / 20);
  std::ranges::nth_element(values, nth);
  return *nth > 0.0F ? 1.0 / *nth : 1.0;
}

absl::StatusOr<std::string> LightingPictures(const LightingEnvironment& environment) {
  std::string html = "<div class=\"pictures\">\n";
  const auto exposure = static_cast<float>(ExposureOf(environment.pictures.front().image));
  for (const LitPicture& picture : environment.pictures) {
    Image image = picture.image;
    for (size_t i = 0; i < image.pixels.size(); ++i) {
      image.pixels[i] *= i % 4 == 3 ? 1.0F : exposure;
    }
    TESSERA_ASSIGN_OR_RETURN(const std::string uri, PngDataUri(image));
    absl::StrAppend(&html, "<figure><img alt=\"\" src=\"", uri, "\"/><figcaption>", picture.title,
                    "</figcaption></figure>\n");
  }
  return html + "</div>\n";
}

}  // namespace

absl::StatusOr<std::string> LightingHtml(const std::vector<LightingChart>& charts) {
  std::string body = absl::StrCat(
      "<h1>", kLightingTitle,
      "</h1>\n<p class=\"lead\">Lights chosen by importance, one after the other, against the environment as "
      "spherical harmonics at once: how far each is from a sum over every texel, and how long it "
      "takes.</p>\n");
  for (const LightingChart& chart : charts) {
    for (const LightingEnvironment& environment : chart.environments) {
      absl::StrAppend(&body, "<h2>", HtmlEscaped(chart.name), ", ", HtmlEscaped(environment.name), "</h2>\n");
      absl::StrAppendFormat(
          &body,
          "<p class=\"facts\">Pictures of %dx%d pixels, the environment of %dx%d texels, the "
          "brightest %.3g times the mean.</p>\n",
          chart.width, chart.height, 2 * environment.height, environment.height, environment.peak);
      TESSERA_ASSIGN_OR_RETURN(const std::string pictures, LightingPictures(environment));
      absl::StrAppend(
          &body, LightingFindings(chart, environment), LightingLegend(), "<div class=\"plots\">",
          LightingPlot(chart, environment, "Against every texel, no shadows", &LightingPoint::error),
          LightingPlot(chart, environment, "Against every texel, with shadows",
                       &LightingPoint::shadowed_error),
          "</div>\n", pictures);
    }
  }
  return HtmlPage(kLightingTitle, absl::StrCat(kChartStyle, kLightingStyle),
                  absl::StrCat(body, kLightingRules));
}

}  // namespace tessera
