// The time of day, passed in so that tests can set it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>

namespace tessera {

// Milliseconds since 1970, UTC.
using Clock = std::function<int64_t()>;

inline int64_t SystemClockMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace tessera
