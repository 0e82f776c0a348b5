// Errors in tests.
#pragma once

#include <string>

#include <absl/status/status.h>

namespace tessera {

// As a std::string, which matchers print as text.
inline std::string Message(const absl::Status& status) {
  return std::string(status.message());
}

}  // namespace tessera
