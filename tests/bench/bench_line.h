// What the benchmarks' programs share: a result or an end, and a line with its verdict.
#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <utility>

#include <absl/status/statusor.h>

namespace tessera {

// Ends the program where there is no result.
template <typename T>
T Must(absl::StatusOr<T> result) {
  if (!result.ok()) {
    std::fprintf(stderr, "%s\n", result.status().ToString().c_str());
    std::exit(EXIT_FAILURE);
  }
  return *std::move(result);
}

// name,value,unit,limit,verdict; without a limit where it is 0. Whether the value keeps within it.
inline bool Print(const std::string& name, double value, const char* unit, double limit) {
  const bool ok = limit <= 0.0 || value <= limit;
  if (limit > 0.0) {
    std::printf("%s,%.4g,%s,%.4g,%s\n", name.c_str(), value, unit, limit, ok ? "ok" : "MISSED");
  } else {
    std::printf("%s,%.4g,%s,,\n", name.c_str(), value, unit);
  }
  std::fflush(stdout);
  return ok;
}

}  // namespace tessera
