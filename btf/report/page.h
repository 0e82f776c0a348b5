// Text of CSV files and of self-contained HTML pages.
//
//   std::string csv = CsvLine({"case", "a, b"});                       // case,"a, b"
//   std::string html = HtmlPage("Title", "h2 { color: red; }", "<p>" + HtmlEscaped(text) + "</p>");
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/image/image.h"

namespace tessera {

// RFC 4180, ended by a line feed.
[[nodiscard]] std::string CsvLine(const std::vector<std::string>& cells);

// For text between tags and inside attributes in double quotes.
[[nodiscard]] std::string HtmlEscaped(std::string_view text);

// The whole file, with the style that all pages share and `style` after it. `body` is well-formed XML.
[[nodiscard]] std::string HtmlPage(std::string_view title, std::string_view style, std::string_view body);

// A picture as "data:image/png;base64,..", for the src of an img. Linear values; errors: EncodePng's.
[[nodiscard]] absl::StatusOr<std::string> PngDataUri(const Image& image);

}  // namespace tessera
