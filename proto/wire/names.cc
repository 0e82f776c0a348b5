#include "proto/wire/names.h"

#include <algorithm>
#include <charconv>

#include <absl/strings/str_cat.h>
#include <absl/strings/string_view.h>

#include "proto/wire/status.h"

namespace tessera {
namespace {

constexpr size_t kMaxIdLength = 63;
constexpr size_t kMaxQuotedLength = 160;
constexpr std::string_view kMaterials = "materials/";
constexpr std::string_view kJobs = "jobs/";
constexpr std::string_view kArrangements = "arrangements/";
constexpr std::string_view kTileSets = "/tileSets/";
constexpr std::string_view kThumbnail = "/thumbnail";

bool IsId(std::string_view text) {
  return !text.empty() && text.size() <= kMaxIdLength && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
  });
}

absl::string_view Quoted(std::string_view text) {
  return {text.data(), std::min(text.size(), kMaxQuotedLength)};
}

absl::Status Invalid(std::string_view name, std::string_view form) {
  return WithReason(
      absl::InvalidArgumentError(absl::StrCat("\"", Quoted(name), "\" is not a name of the form ",
                                              absl::string_view(form.data(), form.size()))),
      "NAME_INVALID", name.substr(0, kMaxQuotedLength));
}

std::string Joined(std::string_view a, std::string_view b) {
  return std::string(a).append(b);
}

}  // namespace

absl::StatusOr<std::string> ParseMaterialName(std::string_view name) {
  if (!name.starts_with(kMaterials) || !IsId(name.substr(kMaterials.size()))) {
    return Invalid(name, "materials/M, M of 1 to 63 characters a-z, 0-9 and -");
  }
  return std::string(name.substr(kMaterials.size()));
}

std::string MaterialName(std::string_view material) {
  return Joined(kMaterials, material);
}

absl::StatusOr<int64_t> ParseJobName(std::string_view name) {
  int64_t job = 0;
  if (name.starts_with(kJobs)) {
    const std::string_view digits = name.substr(kJobs.size());
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), job);
    if (error == std::errc() && end == digits.data() + digits.size() && job > 0 && digits.front() != '0') {
      return job;
    }
  }
  return Invalid(name, "jobs/J, J a positive number");
}

std::string JobName(int64_t job) {
  return Joined(kJobs, std::to_string(job));
}

absl::StatusOr<std::string> ParseArrangementName(std::string_view name) {
  if (!name.starts_with(kArrangements) || !IsId(name.substr(kArrangements.size()))) {
    return Invalid(name, "arrangements/A");
  }
  return std::string(name.substr(kArrangements.size()));
}

std::string ArrangementName(std::string_view arrangement) {
  return Joined(kArrangements, arrangement);
}

absl::StatusOr<TileSetId> ParseTileSetName(std::string_view name) {
  const size_t middle = name.find(kTileSets);
  if (name.starts_with(kArrangements) && middle != std::string_view::npos && middle > kArrangements.size()) {
    const std::string_view arrangement = name.substr(kArrangements.size(), middle - kArrangements.size());
    const std::string_view tile_set = name.substr(middle + kTileSets.size());
    if (IsId(arrangement) && IsId(tile_set)) {
      return TileSetId{std::string(arrangement), std::string(tile_set)};
    }
  }
  return Invalid(name, "arrangements/A/tileSets/T, T of 1 to 63 characters a-z, 0-9 and -");
}

std::string TileSetName(const TileSetId& id) {
  return Joined(kArrangements, id.arrangement).append(kTileSets).append(id.tile_set);
}

absl::StatusOr<TileSetId> ParseThumbnailName(std::string_view name) {
  if (!name.ends_with(kThumbnail)) {
    return Invalid(name, "arrangements/A/tileSets/T/thumbnail");
  }
  return ParseTileSetName(name.substr(0, name.size() - kThumbnail.size()));
}

std::string ThumbnailName(const TileSetId& id) {
  return TileSetName(id).append(kThumbnail);
}

absl::Status CheckDigest(std::string_view sha256, std::string_view field) {
  const bool valid = sha256.size() == 64 && std::all_of(sha256.begin(), sha256.end(), [](char c) {
                       return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
                     });
  if (valid) {
    return absl::OkStatus();
  }
  return WithReason(absl::InvalidArgumentError(absl::StrCat(absl::string_view(field.data(), field.size()),
                                                            " is \"", Quoted(sha256),
                                                            "\", expected 64 lower-case hexadecimal digits")),
                    "ARGUMENT_INVALID", field);
}

}  // namespace tessera
