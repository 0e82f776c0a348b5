// The parts of the chart's page that are text, tables and pictures; plots are in codecs_page.cc.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/chart/codec_chart.h"

namespace tessera {

// "1.23 MB".
[[nodiscard]] std::string MegabytesText(double bytes);
// Sizes and directions of the source, plain text.
[[nodiscard]] std::string FactsOf(const SourceChart& chart);
// What the figures say about the paper's codec, ours and JPEG; empty where those settings are missing.
[[nodiscard]] std::string FindingsList(const SourceChart& chart);
// Reference, decoded and difference at about equal bytes. Errors: EncodePng's.
[[nodiscard]] absl::StatusOr<std::string> CropsHtml(const SourceChart& chart);
[[nodiscard]] std::string PaperHtml(const std::vector<PaperRow>& paper);
// The rules by which all of it was measured.
[[nodiscard]] std::string MethodHtml(const std::vector<SourceChart>& charts);

}  // namespace tessera
