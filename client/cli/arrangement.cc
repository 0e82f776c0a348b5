// tessera arrangement list | show
#include <memory>

#include "btf/base/status_macros.h"
#include "client/cli/commands.h"
#include "client/cli/describe.h"
#include "client/lib/names.h"

namespace tessera::cli {
namespace {

absl::Status ListArrangements(Session& session) {
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const std::vector<v1::Arrangement> arrangements,
                           client->ListArrangements(session.Context()));
  Json all = Json::array();
  std::vector<std::vector<std::string>> rows = {{"ARRANGEMENT", "TILES", "COLOURS", "STRIPS", "SHA-256"}};
  for (const v1::Arrangement& arrangement : arrangements) {
    all.push_back(Describe(arrangement));
    rows.push_back({ShortName(arrangement.name()), std::to_string(arrangement.tile_codes_size()),
                    std::to_string(arrangement.num_colours()),
                    arrangement.turned_strips() ? "turned" : "unturned", arrangement.sha256()});
  }
  session.Answer({{"arrangements", std::move(all)}}, TextTable(rows));
  return absl::OkStatus();
}

absl::Status ShowArrangement(Session& session, const std::string& name) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullArrangementName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const v1::Arrangement arrangement,
                           client->GetArrangement(full_name, session.Context()));
  session.Answer(Describe(arrangement), TextRecord(Describe(arrangement)));
  return absl::OkStatus();
}

}  // namespace

void AddArrangementCommands(CLI::App& app, Session& session) {
  CLI::App* noun = app.add_subcommand("arrangement", "Canonical lists of tiles, independent of material");
  noun->require_subcommand(1);
  CLI::App* list = noun->add_subcommand("list", "Every arrangement");
  list->callback([&session] { session.run = [&session] { return ListArrangements(session); }; });

  const auto name = std::make_shared<std::string>();
  CLI::App* show = noun->add_subcommand("show", "One arrangement and its tile codes");
  show->add_option("ARRANGEMENT", *name, "plane-16, plane-81, surface-26, surface-96..")->required();
  show->callback(
      [&session, name] { session.run = [&session, name] { return ShowArrangement(session, *name); }; });
}

}  // namespace tessera::cli
