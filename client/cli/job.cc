// tessera job list | show | watch | cancel
#include <memory>

#include "btf/base/status_macros.h"
#include "client/cli/commands.h"
#include "client/cli/describe.h"
#include "client/lib/names.h"

namespace tessera::cli {
namespace {

absl::Status ListJobs(Session& session) {
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const std::vector<v1::Job> jobs, client->ListJobs(session.Context()));
  Json all = Json::array();
  std::vector<std::vector<std::string>> rows = {{"JOB", "KIND", "STATE", "ATTEMPT", "RESULT"}};
  for (const v1::Job& job : jobs) {
    all.push_back(Describe(job));
    rows.push_back({ShortName(job.name()), job.kind(), StateName(job.state()), std::to_string(job.attempt()),
                    ShortName(job.result_name())});
  }
  session.Answer({{"jobs", std::move(all)}}, TextTable(rows));
  return absl::OkStatus();
}

absl::Status ShowJob(Session& session, const std::string& name) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullJobName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const v1::Job job, client->GetJob(full_name, session.Context()));
  session.Answer(Describe(job), TextRecord(Describe(job)));
  return absl::OkStatus();
}

// Leaving the watch leaves the job running: `job cancel` ends it.
absl::Status RunWatch(Session& session, const std::string& name, uint64_t after_sequence) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullJobName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const v1::Job job, client->WatchJob(
                                                  full_name, after_sequence,
                                                  [&session](const v1::JobEvent& event) {
                                                    Json line = {{"sequence", event.sequence()}};
                                                    line["job"] = Describe(event.job());
                                                    session.AnswerLine(line, JobLine(event.job()));
                                                  },
                                                  session.Context()));
  return JobFailure(job);
}

absl::Status RunCancel(Session& session, const std::string& name) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullJobName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const v1::Job job, client->CancelJob(full_name, session.Context()));
  session.Answer(Describe(job), JobLine(job));
  return absl::OkStatus();
}

}  // namespace

void AddJobCommands(CLI::App& app, Session& session) {
  CLI::App* noun = app.add_subcommand("job", "Work that the server does or did");
  noun->require_subcommand(1);
  const auto name = std::make_shared<std::string>();
  const auto after_sequence = std::make_shared<uint64_t>(0);

  CLI::App* list = noun->add_subcommand("list", "Every job, with its state");
  list->callback([&session] { session.run = [&session] { return ListJobs(session); }; });

  CLI::App* show = noun->add_subcommand("show", "One job");
  show->add_option("JOB", *name, "Number of the job")->required();
  show->callback([&session, name] { session.run = [&session, name] { return ShowJob(session, *name); }; });

  CLI::App* watch =
      noun->add_subcommand("watch", "A line per event until the job ends; Ctrl-C leaves it running");
  watch->add_option("JOB", *name, "Number of the job")->required();
  watch->add_option("--after", *after_sequence, "Only events with a higher sequence number");
  watch->callback([&session, name, after_sequence] {
    session.run = [&session, name, after_sequence] { return RunWatch(session, *name, *after_sequence); };
  });

  CLI::App* cancel = noun->add_subcommand("cancel", "End a job that waits or runs");
  cancel->add_option("JOB", *name, "Number of the job")->required();
  cancel->callback(
      [&session, name] { session.run = [&session, name] { return RunCancel(session, *name); }; });
}

}  // namespace tessera::cli
