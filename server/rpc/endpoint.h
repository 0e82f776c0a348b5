// The gRPC end of the server: every service, health and reflection on one address.
//
// Unary calls, uploads, downloads and pictures take a thread each while they run, kMaxCallThreads at most; a
// call beyond them is refused with RESOURCE_EXHAUSTED. WatchJob and WaitJob hold no thread while they wait
// (kMaxWatchers in jobs.h bounds them), so any number of watchers leaves the threads to the others.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "server/rpc/backend.h"

namespace tessera {

inline constexpr int kMaxCallThreads = 128;
inline constexpr int kMaxRequestBytes = 4 << 20;

class Endpoint {
 public:
  // `listen` is HOST:PORT, port 0 for a free one. `backend` must outlive it.
  // Errors: UNAVAILABLE when the address cannot be taken.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<Endpoint>> Start(const std::string& listen,
                                                                       const Backend& backend,
                                                                       int num_workers);
  virtual ~Endpoint() = default;

  [[nodiscard]] virtual int port() const = 0;
  // Calls in flight have `grace` to end, then they are cancelled. Returns when all have ended.
  virtual void Stop(std::chrono::milliseconds grace) = 0;
};

}  // namespace tessera
