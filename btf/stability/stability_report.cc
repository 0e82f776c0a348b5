#include <array>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_replace.h>

#include "btf/report/page.h"
#include "btf/stability/stability.h"

namespace tessera {
namespace {

constexpr std::array kColumns = {"case",
                                 "method",
                                 "setting",
                                 "outcome",
                                 "error_measured",
                                 "error_everywhere",
                                 "largest_value",
                                 "largest_coefficient",
                                 "condition",
                                 "error_before_quantisation",
                                 "limit",
                                 "holds",
                                 "says"};

constexpr char kTitle[] = "Where the codecs fail";
constexpr char kStyle[] = R"(
th { position: sticky; top: 0; }
tr.case td { border-top: 2px solid #888; }
tr.no td { background: #fbe3df; }
td.says { min-width: 24em; max-width: 42em; color: #444; }
)";

std::string Figure(const std::optional<double>& value) {
  return value ? absl::StrFormat("%.4g", *value) : "";
}

std::array<std::string, kColumns.size()> Cells(const StabilityRow& row) {
  return {row.stress,
          row.method,
          row.setting,
          row.is_refused ? "refused" : "encoded",
          Figure(row.measured_error),
          Figure(row.everywhere_error),
          Figure(row.largest_value),
          Figure(row.largest_coefficient),
          Figure(row.condition),
          Figure(row.error_before_quantisation),
          row.limit ? Figure(row.limit) : "refusal",
          row.holds ? "yes" : "no",
          row.says};
}

}  // namespace

std::string StabilityCsv(const std::vector<StabilityRow>& rows) {
  std::string csv = CsvLine({kColumns.begin(), kColumns.end()});
  for (const StabilityRow& row : rows) {
    const std::array<std::string, kColumns.size()> cells = Cells(row);
    csv += CsvLine({cells.begin(), cells.end()});
  }
  return csv;
}

std::string StabilityHtml(const std::vector<StabilityRow>& rows) {
  std::string html = R"(<h1>Where the codecs fail</h1>
<p>Errors are root mean squares over that of the truth, a bumpy glossy surface in closed form without the harm done to
the samples: at the measured directions, and everywhere on both hemispheres, beyond the largest measured polar angle
as the format extends it. The largest value is decoded, over the largest of the truth. A row holds when its error
everywhere stays below its limit, or when it is refused as promised; values are finite always.</p>
<table><thead><tr>)";
  for (const char* const column : kColumns) {
    absl::StrAppend(&html, "<th>", absl::StrReplaceAll(column, {{"_", " "}}), "</th>");
  }
  html += "</tr></thead><tbody>\n";
  std::string previous;
  for (const StabilityRow& row : rows) {
    absl::StrAppend(&html, "<tr class=\"", row.stress == previous ? "" : "case", row.holds ? "" : " no",
                    "\">");
    const std::array<std::string, kColumns.size()> cells = Cells(row);
    for (size_t i = 0; i < cells.size(); ++i) {
      const bool is_repeated = i == 0 && row.stress == previous;
      const char* style = i + 1 == cells.size() ? " class=\"says\""
                          : i >= 4 && i <= 10   ? " class=\"figure\""
                                                : "";
      absl::StrAppend(&html, "<td", style, ">", is_repeated ? "" : HtmlEscaped(cells[i]), "</td>");
    }
    html += "</tr>\n";
    previous = row.stress;
  }
  html += "</tbody></table>\n";
  return HtmlPage(kTitle, kStyle, html);
}

}  // namespace tessera
