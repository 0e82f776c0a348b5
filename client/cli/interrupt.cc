#include "client/cli/interrupt.h"

#include <unistd.h>

#include <ctime>

#include "client/cli/exit_codes.h"

namespace tessera::cli {

InterruptWatcher::InterruptWatcher() {
  sigemptyset(&signals_);
  sigaddset(&signals_, SIGINT);
  sigaddset(&signals_, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
  thread_ = std::jthread([this](const std::stop_token& ending) {
    constexpr timespec kPoll = {0, 20'000'000};  // how soon the thread sees that the program ends
    while (!ending.stop_requested()) {
      if (sigtimedwait(&signals_, nullptr, &kPoll) < 0) {
        continue;
      }
      if (stop_.stop_requested()) {
        _exit(kExitInterrupted);
      }
      constexpr char kSaid[] = "\ninterrupted: cancelling (once more to leave at once)\n";
      (void)!write(STDERR_FILENO, kSaid, sizeof(kSaid) - 1);
      stop_.request_stop();
    }
  });
}

InterruptWatcher::~InterruptWatcher() {
  thread_.request_stop();
}

}  // namespace tessera::cli
