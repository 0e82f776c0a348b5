// The command `tessera`. See README.md for its commands and exit codes.
#include <cstdio>

#include "btf/base/cpu_features.h"
#include "client/cli/commands.h"
#include "client/cli/exit_codes.h"
#include "client/cli/interrupt.h"

int main(int argc, char** argv) {
  if (const std::string missing = tessera::MissingCpuFeatures(); !missing.empty()) {
    std::fprintf(stderr, "tessera: this build needs a CPU with %s\n", missing.c_str());
    return tessera::cli::kExitFailure;
  }
  const tessera::cli::InterruptWatcher interrupts;
  return tessera::cli::RunTessera(argc, argv, interrupts.token());
}
