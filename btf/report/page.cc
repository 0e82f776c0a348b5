#include "btf/report/page.h"

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>

#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"

namespace tessera {
namespace {

constexpr char kSharedStyle[] = R"(
body { font: 14px/1.5 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; margin: 2em auto; padding: 0 2em; max-width: 1360px; color: #1f2328; background: #fff; }
table { border-collapse: collapse; }
th { text-align: left; vertical-align: bottom; border-bottom: 2px solid #444; padding: .3em .7em; background: #fff; }
td { border-top: 1px solid #ddd; padding: .25em .7em; vertical-align: top; }
td.figure, th.figure { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
)";

}  // namespace

std::string CsvLine(const std::vector<std::string>& cells) {
  std::string line;
  for (size_t i = 0; i < cells.size(); ++i) {
    const std::string& cell = cells[i];
    absl::StrAppend(&line, i == 0 ? "" : ",");
    if (cell.find_first_of(",\"\r\n") == std::string::npos) {
      line += cell;
    } else {
      absl::StrAppend(&line, "\"", absl::StrReplaceAll(cell, {{"\"", "\"\""}}), "\"");
    }
  }
  line += '\n';
  return line;
}

std::string HtmlEscaped(std::string_view text) {
  return absl::StrReplaceAll(absl::string_view(text.data(), text.size()),
                             {{"&", "&amp;"}, {"<", "&lt;"}, {">", "&gt;"}, {"\"", "&quot;"}});
}

std::string HtmlPage(std::string_view title, std::string_view style, std::string_view body) {
  std::string html = "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><title>";
  html += HtmlEscaped(title);
  html += "</title>\n<style>";
  html += kSharedStyle;
  html += style;
  html += "</style></head>\n<body>\n";
  html += body;
  html += "</body></html>\n";
  return html;
}

absl::StatusOr<std::string> PngDataUri(const Image& image) {
  TESSERA_ASSIGN_OR_RETURN(const std::string png, EncodePng(image));
  return absl::StrCat("data:image/png;base64,", absl::Base64Escape(png));
}

}  // namespace tessera
