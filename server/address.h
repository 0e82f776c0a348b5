// Addresses to listen on.
#pragma once

#include <string>
#include <string_view>

#include <absl/status/statusor.h>

namespace tessera {

struct ListenAddress {
  std::string host;  // without brackets
  int port = 0;      // 0..65535
};

// "HOST:PORT" or "[HOST]:PORT". Errors: INVALID_ARGUMENT naming the text and the form.
[[nodiscard]] absl::StatusOr<ListenAddress> ParseListenAddress(std::string_view text);
// Inverse of the parser.
[[nodiscard]] std::string ListenAddressText(const ListenAddress& address);
// Whether only this machine can reach the host: localhost, 127.0.0.0/8 and ::1, written as such.
[[nodiscard]] bool IsLoopback(const std::string& host);

}  // namespace tessera
