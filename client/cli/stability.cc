// tessera stability
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/stability/stability.h"
#include "client/cli/commands.h"
#include "client/cli/describe.h"
#include "client/cli/exit_codes.h"

namespace tessera::cli {
namespace {

std::string Figure(const std::optional<double>& value) {
  return value ? fmt::format("{:.3g}", *value) : "";
}

absl::Status RunStabilityTable(Session& session, const std::string& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) {
    return absl::InvalidArgumentError(fmt::format("{}: {}", folder, error.message()));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::vector<StabilityRow> rows, RunStability(session.Context()));
  const std::string csv = (std::filesystem::path(folder) / "stability.csv").string();
  const std::string html = (std::filesystem::path(folder) / "stability.html").string();
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(csv, StabilityCsv(rows)));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(html, StabilityHtml(rows)));
  session.FinishStages();
  std::vector<std::vector<std::string>> table = {
      {"CASE", "METHOD", "SETTING", "MEASURED", "EVERYWHERE", "LIMIT", "HOLDS"}};
  size_t num_broken = 0;
  for (const StabilityRow& row : rows) {
    num_broken += row.holds ? 0 : 1;
    table.push_back({row.stress, row.method, row.setting,
                     row.is_refused ? "refused" : Figure(row.measured_error), Figure(row.everywhere_error),
                     row.limit ? Figure(row.limit) : "refusal", row.holds ? "yes" : "NO"});
  }
  session.Answer({{"rows", rows.size()}, {"broken", num_broken}, {"files", {csv, html}}},
                 fmt::format("{}\n{}\n{}", TextTable(table), csv, html));
  return num_broken == 0
             ? absl::OkStatus()
             : absl::InternalError(fmt::format("{} of {} rows break their promise", num_broken, rows.size()));
}

}  // namespace

void AddStabilityCommand(CLI::App& app, Session& session) {
  const auto folder = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand(
      "stability", "Every codec where it fails, and what is said about it; needs no server");
  command->add_option("-o,--output", *folder, "Folder for stability.csv and stability.html")->required();
  command->callback([&session, folder] {
    session.run = [&session, folder] { return RunStabilityTable(session, *folder); };
  });
}

}  // namespace tessera::cli
