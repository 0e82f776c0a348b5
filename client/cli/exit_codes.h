// What the exit code of `tessera` says. Documented in --help and README.md; scripts rely on it.
#pragma once

#include <absl/status/status.h>

namespace tessera::cli {

enum ExitCode : int {
  kExitOk = 0,
  kExitFailure = 1,       // anything else: disk full, file not readable, a fault of ours
  kExitUsage = 2,         // the command line cannot be understood
  kExitNoServer = 3,      // no server at the address, or it went away
  kExitNotFound = 4,      // no such material, tile set, arrangement, job or file
  kExitRefused = 5,       // input or request refused: invalid file, name taken, thresholds not met
  kExitJobFailed = 6,     // the job was accepted and failed, or someone else cancelled it
  kExitInterrupted = 130  // Ctrl-C; the work was cancelled
};

inline constexpr char kExitCodeHelp[] =
    "Exit codes: 0 done; 1 failed (disk, network, a fault); 2 usage; 3 no server; 4 not found;\n"
    "5 input or request refused; 6 job failed; 130 interrupted, work cancelled.";

// A mistake in the command line that only a command can see; ends with kExitUsage.
[[nodiscard]] absl::Status UsageError(absl::string_view message);

// The code that `status` ends the program with.
[[nodiscard]] ExitCode ExitCodeOf(const absl::Status& status);

}  // namespace tessera::cli
