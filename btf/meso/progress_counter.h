// Progress of a parallel loop: counts up from any thread and reports one at a time, never backwards.
#pragma once

#include <cstdint>
#include <mutex>
#include <string_view>

#include "btf/base/run_context.h"

namespace tessera {

// Thread-safe. `context` must outlive it.
class ProgressCounter {
 public:
  ProgressCounter(const RunContext& context, std::string_view stage, uint64_t total, std::string_view unit)
      : context_(context), stage_(stage), total_(total), unit_(unit) {}

  void Add(uint64_t count) {
    const std::lock_guard<std::mutex> lock(mutex_);
    done_ += count;
    context_.Report(stage_, done_, total_, unit_);
  }

 private:
  const RunContext& context_;
  const std::string_view stage_;
  const uint64_t total_;
  const std::string_view unit_;
  std::mutex mutex_;  // guards done_ and the report
  uint64_t done_ = 0;
};

}  // namespace tessera
