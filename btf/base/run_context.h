// What long work receives from its caller: a way to be stopped, a way to tell how far it is, and how many
// threads it may use. Results never depend on it.
//
//   RunContext context;
//   context.progress = [](const Progress& p) { fmt::print("{} {}/{}\n", p.stage, p.done, p.total); };
//   auto material = codec.Encode(source, params, context);
#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <string_view>

#include <absl/status/status.h>

namespace tessera {

// How far one stage has come. `total` is 0 while unknown. `unit` names what is counted ("images", "rows",
// "tiles").
struct Progress {
  std::string_view stage;
  uint64_t done = 0;
  uint64_t total = 0;
  std::string_view unit;
};

struct RunContext {
  std::stop_token stop;
  // Called from whichever thread makes the progress, never from two at once by one piece of work.
  std::function<void(const Progress&)> progress;
  // Upper bound on threads; 0 takes every core.
  int num_threads = 0;

  void Report(std::string_view stage, uint64_t done, uint64_t total, std::string_view unit) const {
    if (progress) {
      progress(Progress{stage, done, total, unit});
    }
  }

  // CANCELLED once a stop was requested, OK before.
  [[nodiscard]] absl::Status CheckStop() const {
    return stop.stop_requested() ? absl::CancelledError("cancelled") : absl::OkStatus();
  }
};

}  // namespace tessera
