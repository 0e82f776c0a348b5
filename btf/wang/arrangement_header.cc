#include "btf/wang/arrangement_header.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/wang/arrangement.h"

namespace tessera {
namespace {

constexpr size_t kMaxIdLength = 63;

bool IsId(const std::string& id) {
  return !id.empty() && id.size() <= kMaxIdLength && std::all_of(id.begin(), id.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-';
  });
}

bool IsSha256(const std::string& digest) {
  return digest.size() == 64 && std::all_of(digest.begin(), digest.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

}  // namespace

absl::Status CheckArrangementName(const ArrangementName& name) {
  if (!IsId(name.id)) {
    return absl::InvalidArgumentError(
        "arrangement: the id is not 1 to 63 lower-case letters, digits and dashes");
  }
  if (!IsSha256(name.sha256)) {
    return absl::InvalidArgumentError(
        absl::StrCat("arrangement ", name.id, ": sha256 is not 64 lower-case hexadecimal digits"));
  }
  const auto known = FindArrangement(name.id);
  if (known.ok() && (*known)->sha256 != name.sha256) {
    return absl::FailedPreconditionError(absl::StrCat("arrangement ", name.id, ": sha256 ", name.sha256,
                                                      ", but here it is ", (*known)->sha256));
  }
  return absl::OkStatus();
}

absl::StatusOr<ArrangementName> ReadArrangementName(const nlohmann::json& header) {
  const auto it = header.find("arrangement");
  if (it == header.end() || !it->is_object()) {
    return absl::InvalidArgumentError("header: 'arrangement' is missing or no object");
  }
  ArrangementName name;
  TESSERA_ASSIGN_OR_RETURN(name.id, HeaderString(*it, "id"));
  TESSERA_ASSIGN_OR_RETURN(name.sha256, HeaderString(*it, "sha256"));
  TESSERA_RETURN_IF_ERROR(CheckArrangementName(name));
  return name;
}

absl::StatusOr<nlohmann::json> ReadObject(const nlohmann::json& header, std::string_view key) {
  const auto it = header.find(key);
  if (it == header.end()) {
    return nlohmann::json::object();
  }
  if (!it->is_object()) {
    return absl::InvalidArgumentError(absl::StrCat("header: '", std::string(key), "' is no object"));
  }
  return *it;
}

absl::StatusOr<int> ReadInteger(const nlohmann::json& header, std::string_view key, int min, int max) {
  const auto it = header.find(key);
  // Larger unsigned numbers than int64 holds wrap around when asked for as int64, so they are told apart
  // first.
  const bool fits = it != header.end() && it->is_number_integer() &&
                    (!it->is_number_unsigned() || it->get<uint64_t>() <= static_cast<uint64_t>(max)) &&
                    it->get<int64_t>() >= min && it->get<int64_t>() <= max;
  if (!fits) {
    return absl::InvalidArgumentError(
        absl::StrCat("header: '", std::string(key), "' is missing or no integer from ", min, " to ", max));
  }
  return it->get<int>();
}

absl::StatusOr<Container> ParseContainerOfKind(std::span<const std::byte> bytes, std::string_view kind) {
  TESSERA_ASSIGN_OR_RETURN(Container container, ParseContainer(bytes));
  TESSERA_RETURN_IF_ERROR(RequireKind(container, kind));
  return container;
}

nlohmann::json OtherKeys(nlohmann::json header, std::initializer_list<const char*> known) {
  for (const char* key : known) {
    header.erase(key);
  }
  return header;
}

}  // namespace tessera
