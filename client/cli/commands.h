// The nouns of the command line: each file adds its commands to the parser and sets Session::run when one is
// chosen.
#pragma once

#include <absl/status/status.h>
#include <CLI/App.hpp>

#include "client/cli/session.h"

namespace tessera::cli {

void AddMaterialCommands(CLI::App& app, Session& session);
void AddArrangementCommands(CLI::App& app, Session& session);
void AddTileSetCommands(CLI::App& app, Session& session);
void AddMeshCommands(CLI::App& app, Session& session);
void AddPreviewCommand(CLI::App& app, Session& session);
void AddSheetCommand(CLI::App& app, Session& session);
void AddStabilityCommand(CLI::App& app, Session& session);
void AddChartCommand(CLI::App& app, Session& session);
void AddJobCommands(CLI::App& app, Session& session);
void AddServerCommands(CLI::App& app, Session& session);
void AddCompletionCommand(CLI::App& app, Session& session);

// Builds the whole parser, runs what the command line asks for and returns the exit code.
[[nodiscard]] int RunTessera(int argc, const char* const* argv, std::stop_token stop);

}  // namespace tessera::cli
