// tessera server status
#include "btf/base/status_macros.h"
#include "client/cli/commands.h"
#include "client/cli/describe.h"

namespace tessera::cli {
namespace {

absl::Status RunStatus(Session& session) {
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const v1::ServerStatus status, client->GetServerStatus(session.Context()));
  Json value = {{"address", client->options().address}};
  value.update(Describe(status));
  session.Answer(value, TextRecord(value));
  return absl::OkStatus();
}

}  // namespace

void AddServerCommands(CLI::App& app, Session& session) {
  CLI::App* noun = app.add_subcommand("server", "The server behind --server");
  noun->require_subcommand(1);
  CLI::App* status = noun->add_subcommand("status", "Version, workers, jobs and what is stored");
  status->callback([&session] { session.run = [&session] { return RunStatus(session); }; });
}

}  // namespace tessera::cli
