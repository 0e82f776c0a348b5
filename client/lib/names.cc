#include "client/lib/names.h"

#include <algorithm>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include "proto/wire/status.h"

namespace tessera {
namespace {

constexpr size_t kLongestName = 63;

absl::string_view AbslView(std::string_view text) {
  return {text.data(), text.size()};
}

bool IsName(std::string_view text) {
  return !text.empty() && text.size() <= kLongestName && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
  });
}

absl::Status BadName(std::string_view what, std::string_view name, std::string_view form) {
  return WithReason(absl::InvalidArgumentError(absl::StrCat(
                        AbslView(what), " name \"", AbslView(name), "\": expected ", AbslView(form),
                        ", each part 1 to ", kLongestName, " of a-z, 0-9 and -")),
                    "NAME_INVALID", name);
}

// `name`, with or without `prefix`, as prefix + one name.
absl::StatusOr<std::string> WithPrefix(std::string_view what, std::string_view prefix,
                                       std::string_view name) {
  std::string_view last = name;
  if (last.starts_with(prefix)) {
    last.remove_prefix(prefix.size());
  }
  if (!IsName(last)) {
    return BadName(what, name, "NAME");
  }
  return absl::StrCat(AbslView(prefix), AbslView(last));
}

}  // namespace

absl::StatusOr<std::string> FullMaterialName(std::string_view name) {
  return WithPrefix("material", "materials/", name);
}

absl::StatusOr<std::string> FullArrangementName(std::string_view name) {
  return WithPrefix("arrangement", "arrangements/", name);
}

absl::StatusOr<std::string> FullJobName(std::string_view name) {
  return WithPrefix("job", "jobs/", name);
}

absl::StatusOr<std::string> FullTileSetName(std::string_view name) {
  const std::vector<std::string> parts = absl::StrSplit(AbslView(name), '/');
  if (parts.size() == 2 && IsName(parts[0]) && IsName(parts[1])) {
    return absl::StrCat("arrangements/", parts[0], "/tileSets/", parts[1]);
  }
  if (parts.size() == 4 && parts[0] == "arrangements" && IsName(parts[1]) && parts[2] == "tileSets" &&
      IsName(parts[3])) {
    return std::string(name);
  }
  return BadName("tile set", name, "ARRANGEMENT/NAME");
}

std::string ShortName(std::string_view full_name) {
  const std::vector<std::string> parts = absl::StrSplit(AbslView(full_name), '/');
  if (parts.size() == 2 && (parts[0] == "materials" || parts[0] == "jobs" || parts[0] == "arrangements")) {
    return parts[1];
  }
  if (parts.size() == 4 && parts[0] == "arrangements" && parts[2] == "tileSets") {
    return absl::StrCat(parts[1], "/", parts[3]);
  }
  return std::string(full_name);
}

}  // namespace tessera
