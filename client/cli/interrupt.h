// Ctrl-C and SIGTERM as a stop request.
#pragma once

#include <csignal>
#include <stop_token>
#include <thread>

namespace tessera::cli {

// From construction on, the first SIGINT or SIGTERM requests a stop and a second one ends the program at once
// with code 130. Construct before any other thread starts: threads inherit the signal mask.
class InterruptWatcher {
 public:
  InterruptWatcher();
  ~InterruptWatcher();
  InterruptWatcher(const InterruptWatcher&) = delete;
  InterruptWatcher& operator=(const InterruptWatcher&) = delete;

  [[nodiscard]] std::stop_token token() const { return stop_.get_token(); }

 private:
  std::stop_source stop_;
  sigset_t signals_;
  std::jthread thread_;
};

}  // namespace tessera::cli
