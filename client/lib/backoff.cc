#include "client/lib/backoff.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <random>

namespace tessera {

Backoff::Backoff(const RetryPolicy& policy, const RunContext& context)
    : policy_(policy), context_(context), rng_(std::random_device{}()), wait_ms_(policy.first_wait_ms) {}

absl::Status Backoff::Wait(const absl::Status& failure) {
  if (attempts_ >= policy_.max_attempts) {
    return failure;
  }
  ++attempts_;
  // Jitter, so that many clients of one restarted server do not come back together.
  const double wait_ms = wait_ms_ * (0.5 + 0.5 * rng_.NextDouble());
  wait_ms_ = std::min<double>(2.0 * wait_ms_, policy_.longest_wait_ms);

  std::mutex mutex;
  std::condition_variable_any wake;
  std::unique_lock lock(mutex);
  wake.wait_for(lock, context_.stop, std::chrono::duration<double, std::milli>(wait_ms),
                [] { return false; });
  return context_.CheckStop();
}

void Backoff::Reset() {
  attempts_ = 1;
  wait_ms_ = policy_.first_wait_ms;
}

}  // namespace tessera
