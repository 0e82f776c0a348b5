// Progress on stderr: a bar with rate and remaining time on a terminal, plain lines elsewhere.
//
//   encode   [##########..........]  50%  64/128 rows   21 rows/s  0:03 left
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "btf/base/run_context.h"

namespace tessera::cli {

// "0:03", "2:10", "1:02:03"; seconds rounded up.
[[nodiscard]] std::string FormatRemaining(double seconds);
// "3.4 MiB" for the unit "bytes", "1234 rows" for others.
[[nodiscard]] std::string FormatAmount(double amount, std::string_view unit);

// One stage of a piece of work, as it went.
struct StageTime {
  std::string stage;
  double seconds = 0;
};

// Thread-safe.
class ProgressMeter {
 public:
  enum class Style {
    kBar,    // one line, redrawn at most ten times a second
    kLines,  // a line per finished stage, and one every ten seconds
    kSilent
  };

  explicit ProgressMeter(Style style);
  ~ProgressMeter();

  void Report(const Progress& progress);
  // Ends the running stage, if any; the next report starts a new one.
  void Finish();
  // Every finished stage, in order.
  [[nodiscard]] std::vector<StageTime> stages() const;

 private:
  using Clock = std::chrono::steady_clock;

  void FinishLocked(Clock::time_point now);
  void Draw(Clock::time_point now) const;
  [[nodiscard]] std::string Line(Clock::time_point now) const;

  const Style style_;
  mutable std::mutex mutex_;  // guards all below
  std::string stage_;
  std::string unit_;
  uint64_t first_done_ = 0;  // where the stage began for us: resumed work is no speed
  uint64_t done_ = 0;
  uint64_t total_ = 0;
  Clock::time_point stage_start_;
  Clock::time_point last_drawn_;
  std::vector<StageTime> stages_;
};

}  // namespace tessera::cli
