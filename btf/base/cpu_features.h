// The instruction sets the build needs, checked at program start so that an old machine gets a sentence, not
// SIGILL.
#pragma once

#include <string>

namespace tessera {

// Names of required instruction sets this CPU lacks, comma-separated; empty when all are present or the build
// needs none. Compiled without those instructions, so it is safe to call first in main().
[[nodiscard]] std::string MissingCpuFeatures();

}  // namespace tessera
