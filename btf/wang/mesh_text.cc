#include "btf/wang/mesh_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";
// What a message quotes of a word: hostile files have long ones, and bytes that no terminal should get.
constexpr size_t kQuotedBytes = 32;

std::string Quoted(std::string_view word) {
  std::string text(word.substr(0, kQuotedBytes));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return absl::StrCat("'", text, word.size() > kQuotedBytes ? ".." : "", "'");
}

absl::StatusOr<float> ParseFloat(const LineReader& reader, std::string_view word) {
  // from_chars takes a minus sign itself, and must not find one behind the plus.
  const std::string_view digits = word.starts_with('+') && !word.starts_with("+-") ? word.substr(1) : word;
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || end != digits.data() + digits.size() ||
      !std::isfinite(static_cast<float>(value))) {
    return LineError(reader, Quoted(word) + " is not a finite number");
  }
  return static_cast<float>(value);
}

}  // namespace

bool LineReader::Next() {
  joined_.clear();
  words_.clear();
  while (words_.empty() && !text_.empty()) {
    line_ = next_line_;
    std::string_view line;
    for (bool more = true; more && !text_.empty();) {
      const size_t end = std::min(text_.find('\n'), text_.size());
      line = text_.substr(0, end);
      text_.remove_prefix(std::min(end + 1, text_.size()));
      ++next_line_;
      line = line.substr(0, line.find('#'));
      line = line.substr(0, line.find_last_not_of(kBlanks) + 1);
      more = line.ends_with('\\');
      if (more) {
        line.remove_suffix(1);
      }
      if (more || !joined_.empty()) {
        absl::StrAppend(&joined_, std::string(line), " ");
      }
    }
    if (!joined_.empty()) {
      line = joined_;
    }
    for (size_t begin = line.find_first_not_of(kBlanks); begin != std::string_view::npos;
         begin = line.find_first_not_of(kBlanks, begin)) {
      const size_t end = std::min(line.find_first_of(kBlanks, begin), line.size());
      words_.push_back(line.substr(begin, end - begin));
      begin = end;
    }
    if (words_.empty()) {
      joined_.clear();
    }
  }
  return !words_.empty();
}

absl::Status LineError(const LineReader& reader, std::string_view message) {
  return absl::InvalidArgumentError(absl::StrCat("line ", reader.line(), ": ", std::string(message)));
}

absl::StatusOr<Eigen::Vector3f> ParseVector(const LineReader& reader, size_t first) {
  if (reader.words().size() < first + 3) {
    return LineError(reader, absl::StrCat(reader.words().size() - std::min(first, reader.words().size()),
                                          " numbers, expected 3"));
  }
  Eigen::Vector3f vector;
  for (size_t i = 0; i < 3; ++i) {
    TESSERA_ASSIGN_OR_RETURN(vector[static_cast<Eigen::Index>(i)],
                             ParseFloat(reader, reader.words()[first + i]));
  }
  return vector;
}

absl::StatusOr<int64_t> ParseWhole(const LineReader& reader, std::string_view word) {
  int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || end != word.data() + word.size()) {
    return LineError(reader, Quoted(word) + " is not a whole number");
  }
  return value;
}

void RawMesh::AddFan(std::span<const uint32_t> corners) {
  for (size_t corner = 2; corner < corners.size(); ++corner) {
    triangles.push_back({corners[0], corners[corner - 1], corners[corner]});
  }
  faces_fanned += corners.size() > 3;
}

bool FaceTally::Add(size_t corners, size_t line) {
  ++faces_;
  if (kind_ == FaceKind::kQuads ? corners == 4 : corners >= 3) {
    return true;
  }
  if (others_++ == 0) {
    first_face_ = faces_;
    first_corners_ = corners;
    first_line_ = line;
  }
  return false;
}

absl::Status FaceTally::Check() const {
  if (others_ == 0) {
    return absl::OkStatus();
  }
  const std::string kind = first_corners_ == 3  ? "a triangle"
                           : first_corners_ < 3 ? absl::StrCat("a face of ", first_corners_, " corners")
                                                : absl::StrCat("an n-gon of ", first_corners_, " corners");
  return absl::InvalidArgumentError(absl::StrCat(
      "face ", first_face_, " (line ", first_line_, ") is ", kind,
      kind_ == FaceKind::kQuads ? "; only quads can be dressed (" : "; expected three corners or more (",
      others_, " of ", faces_, " faces are something else)"));
}

}  // namespace tessera
