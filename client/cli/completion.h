// Shell completion, written from the parser itself.
#pragma once

#include <string>

#include <CLI/App.hpp>

namespace tessera::cli {

// A bash script that completes commands, options and, where neither fits, file names.
[[nodiscard]] std::string BashCompletion(const CLI::App& app);

}  // namespace tessera::cli
