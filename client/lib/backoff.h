// Waiting between attempts of a call that found no server.
//
//   Backoff backoff(policy, context);
//   while (true) {
//     absl::Status status = Attempt();
//     if (!absl::IsUnavailable(status)) return status;
//     TESSERA_RETURN_IF_ERROR(backoff.Wait(status));
//   }
#pragma once

#include <absl/status/status.h>

#include "btf/base/rng.h"
#include "btf/base/run_context.h"
#include "client/lib/client.h"

namespace tessera {

// The waits of one RetryPolicy. Not thread-safe.
class Backoff {
 public:
  Backoff(const RetryPolicy& policy, const RunContext& context);

  // Sleeps before the next attempt. Returns `failure` once the attempts are used up, CANCELLED as soon as the
  // context asks for a stop.
  [[nodiscard]] absl::Status Wait(const absl::Status& failure);

  // The last attempt got further: count from the first again.
  void Reset();

 private:
  const RetryPolicy policy_;
  const RunContext& context_;
  Rng rng_;
  int attempts_ = 1;
  double wait_ms_;
};

}  // namespace tessera
