#include "btf/chart/page_parts.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/status_macros.h"
#include "btf/image/transfer.h"
#include "btf/metrics/flip.h"
#include "btf/metrics/ssim.h"
#include "btf/report/page.h"

namespace tessera {
namespace {

constexpr double kDifferenceGain = 4.0;  // of the pictures of differences

const ChartPoint* Find(const SourceChart& chart, std::string_view method, std::string_view setting) {
  const auto found = std::ranges::find_if(chart.points, [&](const ChartPoint& point) {
    return point.method == method && point.setting == setting && point.refusal.empty();
  });
  return found == chart.points.end() ? nullptr : &*found;
}

double Rmse(const ChartPoint& point, size_t split) {
  return (*point.splits[split])[kAllAngles].squares.rmse();
}

const char* PlaceOf(Split split) {
  switch (split) {
    case Split::kSampled:
      return "sampled directions";
    case Split::kHeldOutLights:
      return "held-out lights";
    case Split::kHeldOutViews:
      return "held-out views";
  }
  return "";
}

std::string TimeText(double seconds) {
  const auto whole = static_cast<int64_t>(std::lround(seconds));
  return seconds < 60.0 ? absl::StrFormat("%.1f s", seconds)
                        : absl::StrFormat("%d:%02d:%02d", whole / 3600, whole / 60 % 60, whole % 60);
}

// kDifferenceGain times the difference of sRGB-coded values, to be shown as it is.
Image DifferenceOf(const Image& reference, const Image& image) {
  const Image a = SrgbCoded(reference);
  const Image b = SrgbCoded(image);
  Image difference = a;
  for (size_t i = 0; i < difference.pixels.size(); ++i) {
    const double shown = std::min(1.0, kDifferenceGain * std::abs(a.pixels[i] - b.pixels[i]));
    difference.pixels[i] = static_cast<float>(LinearFromSrgb(shown));
  }
  return difference;
}

double RmseOf(const Image& reference, const Image& image) {
  double sum = 0.0;
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    const double error = static_cast<double>(image.pixels[i]) - reference.pixels[i];
    sum += error * error;
  }
  return std::sqrt(sum / static_cast<double>(image.pixels.size()));
}

}  // namespace

std::string MegabytesText(double bytes) {
  return absl::StrFormat("%.2f MB", 1e-6 * bytes);
}

std::string FactsOf(const SourceChart& chart) {
  std::string text = absl::StrFormat(
      "%dx%d texels, %d views, %d lights: %d images, %s as 8-bit RGB. Radiometry: %s.", chart.width,
      chart.height, chart.views.size(), chart.lights.size(), chart.views.size() * chart.lights.size(),
      MegabytesText(static_cast<double>(chart.RawBytes())), chart.radiometry);
  if (!chart.part.empty()) {
    absl::StrAppend(&text, " Charted: ", chart.part, ".");
  }
  for (const ChartPoint& point : chart.points) {
    if (point.splits[0]) {
      absl::StrAppendFormat(&text, " RMS of the samples: %.4f.",
                            (*point.splits[0])[kAllAngles].squares.reference_rms());
      break;
    }
  }
  return text;
}

std::string FindingsList(const SourceChart& chart) {
  std::string items;
  const ChartPoint* const dsh = Find(chart, "dsh", "25x25");
  const ChartPoint* const cls = Find(chart, "dsh-cls", "25x25");
  const ChartPoint* const cls_sphere = Find(chart, "dsh-cls 4pi", "25x25");
  if (dsh != nullptr && cls != nullptr && cls_sphere != nullptr) {
    absl::StrAppendFormat(
        &items,
        "<li>At the bytes of the paper's codec (25x25 coefficients, %s) <b>dsh</b> has %.2f times "
        "the RMSE of <b>dsh-cls</b> with the energy of the hemisphere, %.2f times that with the "
        "energy of the sphere.</li>\n",
        MegabytesText(static_cast<double>(dsh->size_bytes)), Rmse(*dsh, 0) / Rmse(*cls, 0),
        Rmse(*dsh, 0) / Rmse(*cls_sphere, 0));
  }
  for (size_t split = 0; dsh != nullptr && split < kSplits.size(); ++split) {
    const ChartPoint* least = nullptr;
    for (const ChartPoint& point : chart.points) {
      if (dsh->splits[split] && point.splits[split] && Rmse(point, split) <= Rmse(*dsh, split) &&
          (least == nullptr || point.size_bytes < least->size_bytes)) {
        least = &point;
      }
    }
    if (least == dsh) {
      absl::StrAppendFormat(&items, "<li>At %s nothing smaller is as good as dsh 25x25, RMSE %.4f.</li>\n",
                            PlaceOf(kSplits[split]), Rmse(*dsh, split));
    } else if (least != nullptr) {
      absl::StrAppendFormat(&items,
                            "<li>At %s the smallest that is no worse than dsh 25x25 (RMSE %.4f) is <b>%s "
                            "%s</b>, %.4f in %s: 1/%.1f "
                            "of the bytes.</li>\n",
                            PlaceOf(kSplits[split]), Rmse(*dsh, split), HtmlEscaped(least->method),
                            HtmlEscaped(least->setting), Rmse(*least, split),
                            MegabytesText(static_cast<double>(least->size_bytes)),
                            static_cast<double>(dsh->size_bytes) / static_cast<double>(least->size_bytes));
    }
  }
  const ChartPoint* smallest_jpeg = nullptr;
  for (const ChartPoint& point : chart.points) {
    if (point.method == kJpegMethod &&
        (smallest_jpeg == nullptr || point.size_bytes < smallest_jpeg->size_bytes)) {
      smallest_jpeg = &point;
    }
  }
  if (smallest_jpeg != nullptr) {
    absl::StrAppendFormat(
        &items,
        "<li>JPEG files go no lower than %s (%s), with an RMSE of %.4f; at held-out directions they "
        "can only show the nearest image.</li>\n",
        MegabytesText(static_cast<double>(smallest_jpeg->size_bytes)), HtmlEscaped(smallest_jpeg->setting),
        Rmse(*smallest_jpeg, 0));
  }
  return items.empty() ? "" : absl::StrCat("<ul class=\"findings\">\n", items, "</ul>\n");
}

absl::StatusOr<std::string> CropsHtml(const SourceChart& chart) {
  std::string html;
  for (const CropGroup& group : chart.groups) {
    absl::StrAppend(&html, "<h3>Side by side, ", HtmlEscaped(group.title), "</h3>\n");
    for (size_t c = 0; c < chart.crops.size(); ++c) {
      const ChartCrop& crop = chart.crops[c];
      TESSERA_ASSIGN_OR_RETURN(const std::string reference, PngDataUri(crop.reference));
      absl::StrAppend(&html, "<p class=\"pair\">", HtmlEscaped(crop.title),
                      "</p>\n<div class=\"crops\"><figure><img alt=\"reference\" src=\"", reference,
                      "\"/><div class=\"blank\">difference,<br/>", kDifferenceGain,
                      " times</div><figcaption><b>reference</b></figcaption></figure>\n");
      for (const size_t index : group.points) {
        const ChartPoint& point = chart.points[index];
        if (point.crops[c].pixels.empty()) {
          continue;  // refused in this split
        }
        TESSERA_ASSIGN_OR_RETURN(const std::string decoded, PngDataUri(point.crops[c]));
        TESSERA_ASSIGN_OR_RETURN(const std::string difference,
                                 PngDataUri(DifferenceOf(crop.reference, point.crops[c])));
        absl::StrAppendFormat(
            &html,
            "<figure><img alt=\"decoded\" src=\"%s\"/><img alt=\"difference\" src=\"%s\"/>"
            "<figcaption><b>%s %s</b>%s<br/>RMSE %.4f<br/>FLIP %.4f</figcaption></figure>\n",
            decoded, difference, HtmlEscaped(point.method), HtmlEscaped(point.setting),
            MegabytesText(static_cast<double>(point.size_bytes)), RmseOf(crop.reference, point.crops[c]),
            Flip(crop.reference, point.crops[c]));
      }
      html += "</div>\n";
    }
  }
  return html;
}

std::string PaperHtml(const std::vector<PaperRow>& paper) {
  std::string html =
      "<h2>Table II of [Leung2007], ours beside it</h2>\n<p class=\"facts\">Time and size of the "
      "compression. The paper's "
      "figures are from a Pentium IV at 3.2 GHz and from measured BTFs that are not public; ours are from "
      "this machine and "
      "from generated:reactdiffuse, 128x128 texels under 81 lights and 81 views, repeated without a seam to "
      "the row's "
      "size. Times are wall clock without reading the source; rates count every byte of the container, raw "
      "is 8-bit RGB. "
      "dsh-cls is the paper's codec, dsh ours with as many coefficients, dfmf ours at its default.</p>\n"
      "<div class=\"wide\"><table><thead><tr><th>resolution</th><th class=\"figure\">kv</th><th "
      "class=\"figure\">kl</th>"
      "<th class=\"figure\">paper</th><th class=\"figure\">rate</th>";
  for (const char* const method : {"dsh-cls", "dsh", "dfmf"}) {
    absl::StrAppend(&html, "<th class=\"figure\">", method,
                    "</th><th class=\"figure\">faster</th><th class=\"figure\">rate</th><th "
                    "class=\"figure\">relative RMSE</th>");
  }
  html += "</tr></thead><tbody>\n";
  for (const PaperRow& row : paper) {
    absl::StrAppendFormat(
        &html,
        "<tr><td class=\"method\">%dx%dx81x81, %s</td><td class=\"figure\">%d</td><td "
        "class=\"figure\">%d</td><td class=\"figure\">%s</td><td class=\"figure\">%.2f%%</td>",
        row.side, row.side, MegabytesText(static_cast<double>(row.RawBytes())), row.kv, row.kl,
        TimeText(row.paper_s), 100.0 * row.paper_rate);
    if (row.runs.empty()) {
      html += "<td colspan=\"12\">not run: ask for it with --paper-largest</td>";
    }
    for (const PaperRun& run : row.runs) {
      absl::StrAppendFormat(&html,
                            "<td class=\"figure\">%s</td><td class=\"figure\">%.0fx</td><td "
                            "class=\"figure\">%.2f%%</td><td class=\"figure\">%.4f</td>",
                            TimeText(run.encode_s), row.paper_s / run.encode_s,
                            100.0 * static_cast<double>(run.size_bytes) / static_cast<double>(row.RawBytes()),
                            run.relative_rmse);
    }
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string MethodHtml(const std::vector<SourceChart>& charts) {
  std::string html = R"(<h2>How it is measured</h2>
<ul>
<li><b>Bytes</b> are those of the whole container: coefficients, tables, directions, header. Of JPEG, all files.</li>
<li><b>Held out</b> are whole directions, every fifth in the source's order (indices 4, 9, 14, ..): in one run lights with all
their views, in another views with all their lights. Each setting is encoded three times, on everything, without those lights,
without those views; bytes and costs are those of the first. Errors on held-out directions compare decoding at a direction that
the codec has not seen with the image measured there.</li>
<li><b>Angles</b>: a pair counts up to a limit when the polar angles of its view and of its light are at most that, 45, 60 and 75
degrees; "all" has every pair.</li>
<li><b>RMSE, relative RMSE</b> (over the RMS of the same samples) and <b>PSNR</b> take all pairs and every n-th row of texels,
from the first; relative RMSE and RMSE of linear values, PSNR of sRGB-coded values clamped to [0, 1], squares pooled over all.
In plots, what lies above the largest error of a setting whose RMSE is below half the RMS of the samples is an arrow at the
upper edge.</li>
<li><b>DSSIM and FLIP</b> take whole pictures, a fixed number from each class of angles (up to 45, beyond it up to 60, to 75, beyond): those with
the smallest hash of their index. Each class counts by the number of its pairs.</li>
<li><b>Decoding on the CPU</b>: processor time of one thread, all texels of one view and light (streaming), or another texel, view
and light each time (random). <b>GL frame</b>: wall clock of a frame of 640x480 on OSMesa that a plane covers whole, 0.7 texels to
the pixel, one texel a pixel (nearest) or four (bilinear); "prepare" is what comes before the first picture of a material: packing and sending its tables. Frames are the least of up to three.</li>
<li><b>Encoding</b>: wall clock and the processor time of all threads, with reading the source from memory.</li>
<li><b>JPEG</b>: baseline, 4:2:0, Huffman tables of its own for each file, of sRGB codes: values above 1 are cut. Its access to one
texel decodes one file. It has no images at held-out directions: the nearest measured one is shown, and the held-out ones are not
taken out of its bytes.</li>
</ul>
)";
  if (charts.empty()) {
    return html;
  }
  html +=
      "<table><thead><tr><th>source</th><th class=\"figure\">every n-th row</th><th "
      "class=\"figure\">pictures a "
      "class</th></tr></thead><tbody>\n";
  for (const SourceChart& chart : charts) {
    absl::StrAppend(&html, "<tr><td>", HtmlEscaped(chart.name), "</td><td class=\"figure\">",
                    chart.row_stride, "</td><td class=\"figure\">", chart.pictures_per_class, "</td></tr>\n");
  }
  return html + "</tbody></table>\n";
}

}  // namespace tessera
