#include <cstdlib>
#include <exception>
#include <memory>

#include <fmt/format.h>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include "client/cli/commands.h"
#include "client/cli/exit_codes.h"

namespace tessera::cli {
namespace {

constexpr char kVersion[] = "tessera " TESSERA_VERSION;

}  // namespace

int RunTessera(int argc, const char* const* argv, std::stop_token stop) {
  Session session(std::move(stop));
  session.server = std::string(kDefaultServerAddress);

  CLI::App app("Tileable BTFs: materials, tile sets in canonical arrangements, dressed meshes, previews.",
               "tessera");
  app.fallthrough();  // global options may follow the command
  app.require_subcommand(1);
  app.footer(kExitCodeHelp);
  app.set_version_flag("--version", kVersion);
  app.add_option("--server", session.server, "HOST:PORT of the server")
      ->envname("TESSERA_SERVER")
      ->capture_default_str();
  app.add_flag("--json", session.json, "Answer with JSON on stdout; errors as one JSON object on stderr");
  app.add_flag("-q,--quiet", session.quiet, "No progress and no remarks on stderr");
  AddMaterialCommands(app, session);
  AddArrangementCommands(app, session);
  AddTileSetCommands(app, session);
  AddMeshCommands(app, session);
  AddPreviewCommand(app, session);
  AddSheetCommand(app, session);
  AddStabilityCommand(app, session);
  AddChartCommand(app, session);
  AddJobCommands(app, session);
  AddServerCommands(app, session);
  AddCompletionCommand(app, session);

  // CLI11 throws what it has to say.
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  }
  absl::Status status;
  try {
    status = session.run();
  } catch (const std::exception& error) {  // allocation, above all
    status = absl::InternalError(error.what());
  }
  if (!status.ok()) {
    session.Fail(status);
  }
  return ExitCodeOf(status);
}

}  // namespace tessera::cli
