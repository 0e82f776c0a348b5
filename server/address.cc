#include "server/address.h"

#include <charconv>

#include <arpa/inet.h>

#include <absl/strings/str_cat.h>

namespace tessera {

absl::StatusOr<ListenAddress> ParseListenAddress(std::string_view text) {
  ListenAddress address;
  const size_t colon = text.rfind(':');
  if (colon != std::string_view::npos) {
    std::string_view host = text.substr(0, colon);
    const std::string_view port = text.substr(colon + 1);
    const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
    if (bracketed) {
      host = host.substr(1, host.size() - 2);
    }
    const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), address.port);
    const bool port_ok = error == std::errc() && end == port.data() + port.size() && !port.empty() &&
                         address.port >= 0 && address.port <= 65535;
    if (port_ok && !host.empty() && (bracketed || host.find(':') == std::string_view::npos)) {
      address.host = std::string(host);
      return address;
    }
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "\"", std::string(text), "\" is no address to listen on, expected HOST:PORT or [HOST]:PORT"));
}

std::string ListenAddressText(const ListenAddress& address) {
  const bool ipv6 = address.host.find(':') != std::string::npos;
  return absl::StrCat(ipv6 ? "[" : "", address.host, ipv6 ? "]:" : ":", address.port);
}

bool IsLoopback(const std::string& host) {
  in_addr v4{};
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) {
    return (ntohl(v4.s_addr) >> 24) == 127;
  }
  in6_addr v6{};
  if (inet_pton(AF_INET6, host.c_str(), &v6) == 1) {
    return IN6_IS_ADDR_LOOPBACK(&v6);
  }
  return host == "localhost";
}

}  // namespace tessera
