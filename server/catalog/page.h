// Pages of a list: how many rows at most, after which key.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <absl/status/statusor.h>

namespace tessera {

inline constexpr uint32_t kDefaultPageSize = 100;
inline constexpr uint32_t kMaxPageSize = 1000;

struct Page {
  uint32_t size = kDefaultPageSize;  // 1..kMaxPageSize
  std::string after;                 // key of the last row of the page before; empty: from the start
};

// `list` names what is listed, filter included: a token is valid for the same list only.
// Errors: INVALID_ARGUMENT naming the page size and its limit, or a token that is not one of this list.
[[nodiscard]] absl::StatusOr<Page> ParsePage(std::string_view list, uint32_t page_size,
                                             std::string_view token);
[[nodiscard]] std::string PageToken(std::string_view list, std::string_view last_key);

}  // namespace tessera
