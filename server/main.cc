// Compiled for the plain architecture: it checks the CPU before any other code of ours runs.
#include <cstdio>
#include <string>

#include "btf/base/cpu_features.h"
#include "server/command.h"

int main(int argc, char** argv) {
  const std::string missing = tessera::MissingCpuFeatures();
  if (!missing.empty()) {
    std::fprintf(stderr, "tessera-server: this CPU lacks %s, which this build needs\n", missing.c_str());
    return 1;
  }
  return tessera::RunServerCommand(argc, argv);
}
