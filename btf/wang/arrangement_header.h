// The header keys that tile sets and dressings share: `arrangement` {id, sha256}, `metadata`, and the keys
// that this version does not know.
#pragma once

#include <cstddef>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/codec/container.h"

namespace tessera {

struct ArrangementName {
  std::string id;
  std::string sha256;
};

// OK when `name` has a plausible id and 64 hexadecimal digits and, if this library has an arrangement of that
// id, its digest. Errors: INVALID_ARGUMENT, FAILED_PRECONDITION naming both digests.
[[nodiscard]] absl::Status CheckArrangementName(const ArrangementName& name);

// header["arrangement"], checked. Errors: also INVALID_ARGUMENT when it is missing or misshapen.
[[nodiscard]] absl::StatusOr<ArrangementName> ReadArrangementName(const nlohmann::json& header);

// header[key], an empty object when absent. Errors: INVALID_ARGUMENT when it is no object.
[[nodiscard]] absl::StatusOr<nlohmann::json> ReadObject(const nlohmann::json& header, std::string_view key);

// header[key] as an integer in [min, max]. Errors: INVALID_ARGUMENT naming the key, the value and the limits.
[[nodiscard]] absl::StatusOr<int> ReadInteger(const nlohmann::json& header, std::string_view key, int min,
                                              int max);

// The container of this kind, parsed. Errors: as ParseContainer, INVALID_ARGUMENT naming both kinds.
[[nodiscard]] absl::StatusOr<Container> ParseContainerOfKind(std::span<const std::byte> bytes,
                                                             std::string_view kind);

// `header` without the keys named.
[[nodiscard]] nlohmann::json OtherKeys(nlohmann::json header, std::initializer_list<const char*> known);

}  // namespace tessera
