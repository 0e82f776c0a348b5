#include "server/catalog/page.h"

#include <span>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>

#include "btf/base/sha256.h"
#include "proto/wire/status.h"

namespace tessera {
namespace {

constexpr size_t kTagLength = 8;

std::string ListTag(std::string_view list) {
  return Sha256Hex(std::as_bytes(std::span(list))).substr(0, kTagLength);
}

}  // namespace

absl::StatusOr<Page> ParsePage(std::string_view list, uint32_t page_size, std::string_view token) {
  if (page_size > kMaxPageSize) {
    return WithReason(
        absl::InvalidArgumentError(absl::StrCat("page_size ", page_size, ", at most ", kMaxPageSize)),
        "ARGUMENT_INVALID", "page_size");
  }
  Page page;
  page.size = page_size == 0 ? kDefaultPageSize : page_size;
  if (token.empty()) {
    return page;
  }
  std::string text;
  if (!absl::WebSafeBase64Unescape(absl::string_view(token.data(), token.size()), &text) ||
      text.size() <= kTagLength || !text.starts_with(ListTag(list))) {
    return WithReason(absl::InvalidArgumentError("page_token is not one that this list returned"),
                      "ARGUMENT_INVALID", "page_token");
  }
  page.after = text.substr(kTagLength);
  return page;
}

std::string PageToken(std::string_view list, std::string_view last_key) {
  return absl::WebSafeBase64Escape(ListTag(list).append(last_key));
}

}  // namespace tessera
