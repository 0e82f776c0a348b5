#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/chart/codec_chart.h"
#include "btf/report/page.h"

namespace tessera {
namespace {

std::string Number(double value) {
  return std::isfinite(value) ? absl::StrFormat("%.6g", value) : "inf";
}

}  // namespace

std::string CodecsCsv(const std::vector<SourceChart>& charts) {
  std::string csv = CsvLine({"source",
                             "method",
                             "setting",
                             "split",
                             "angle_limit_deg",
                             "bytes",
                             "rate",
                             "encode_s",
                             "encode_cpu_s",
                             "streaming_ns",
                             "random_us",
                             "gl_nearest_ms",
                             "gl_bilinear_ms",
                             "gl_prepare_ms",
                             "rmse",
                             "relative_rmse",
                             "psnr_db",
                             "dssim",
                             "flip",
                             "pairs",
                             "row_stride",
                             "pictures",
                             "pictures_per_class",
                             "refusal"});
  for (const SourceChart& chart : charts) {
    for (const ChartPoint& point : chart.points) {
      if (!point.splits[0]) {
        std::vector<std::string> cells(24);
        cells[0] = chart.name;
        cells[1] = point.method;
        cells[2] = point.setting;
        cells[23] = point.refusal;
        csv += CsvLine(cells);
        continue;
      }
      const auto milliseconds = [&](double GlFrameCost::*member) {
        return point.gl ? Number(1e3 * (*point.gl).*member) : "";
      };
      for (size_t split = 0; split < kSplits.size(); ++split) {
        for (size_t limit = 0; point.splits[split] && limit < kNumAngleLimits; ++limit) {
          const LimitFigures& figures = (*point.splits[split])[limit];
          if (figures.num_pairs == 0) {
            continue;
          }
          csv +=
              CsvLine({chart.name,
                       point.method,
                       point.setting,
                       SplitName(kSplits[split]),
                       kAngleLimitNames[limit],
                       absl::StrCat(point.size_bytes),
                       Number(static_cast<double>(point.size_bytes) / static_cast<double>(chart.RawBytes())),
                       Number(point.encode_s),
                       Number(point.encode_cpu_s),
                       Number(1e9 * point.cpu.streaming_s),
                       Number(1e6 * point.cpu.random_s),
                       milliseconds(&GlFrameCost::nearest_s),
                       milliseconds(&GlFrameCost::bilinear_s),
                       milliseconds(&GlFrameCost::prepare_s),
                       Number(figures.squares.rmse()),
                       Number(figures.squares.relative_rmse()),
                       Number(figures.squares.psnr_db()),
                       Number(figures.dssim),
                       Number(figures.flip),
                       absl::StrCat(figures.num_pairs),
                       absl::StrCat(chart.row_stride),
                       absl::StrCat(figures.num_pictures),
                       absl::StrCat(chart.pictures_per_class),
                       point.refusal});
        }
      }
    }
  }
  return csv;
}

}  // namespace tessera
