#include "client/cli/session.h"

#include <cstdio>
#include <utility>

#include <fmt/format.h>
#include <unistd.h>

#include "client/cli/exit_codes.h"
#include "proto/wire/status.h"

namespace tessera::cli {

Session::Session(std::stop_token stop) : stop_(std::move(stop)) {}

absl::StatusOr<Client*> Session::Connect() {
  if (client_ == nullptr) {
    absl::StatusOr<std::unique_ptr<Client>> client =
        Client::Connect({.address = server}, RunContext{.stop = stop_});
    if (!client.ok()) {
      return absl::IsInvalidArgument(client.status()) ? UsageError(client.status().message())
                                                      : client.status();
    }
    client_ = *std::move(client);
  }
  return client_.get();
}

ProgressMeter& Session::Meter() {
  if (meter_ == nullptr) {
    meter_ = std::make_unique<ProgressMeter>(quiet                   ? ProgressMeter::Style::kSilent
                                             : isatty(STDERR_FILENO) ? ProgressMeter::Style::kBar
                                                                     : ProgressMeter::Style::kLines);
  }
  return *meter_;
}

RunContext Session::Context() {
  ProgressMeter& meter = Meter();
  return {.stop = stop_, .progress = [&meter](const Progress& progress) { meter.Report(progress); }};
}

std::vector<StageTime> Session::FinishStages() {
  Meter().Finish();
  return Meter().stages();
}

Json Session::JsonOfStages(const std::vector<StageTime>& stages) {
  Json all = Json::array();
  for (const StageTime& stage : stages) {
    all.push_back({{"stage", stage.stage}, {"seconds", stage.seconds}});
  }
  return all;
}

void Session::Answer(const Json& value, std::string_view text) const {
  // Text that came in from files may not be UTF-8; JSON must be.
  constexpr int kIndent = 2;
  const std::string shown =
      json ? value.dump(kIndent, ' ', false, Json::error_handler_t::replace) : std::string(text);
  if (!shown.empty()) {
    fmt::print("{}\n", shown);
  }
  std::fflush(stdout);
}

void Session::AnswerLine(const Json& value, std::string_view text) const {
  fmt::print("{}\n", json ? value.dump(-1, ' ', false, Json::error_handler_t::replace) : std::string(text));
  std::fflush(stdout);
}

void Session::Note(std::string_view text) {
  if (!quiet) {
    Meter().Finish();
    fmt::print(stderr, "{}\n", text);
  }
}

void Session::Warn(std::string_view text) {
  Meter().Finish();
  fmt::print(stderr, "warning: {}\n", text);
}

void Session::Fail(const absl::Status& status) {
  Meter().Finish();
  const ExitCode code = ExitCodeOf(status);
  std::string message(status.message());
  std::string hint;
  if (code == kExitNoServer) {
    hint = fmt::format("start one with: tessera-server --data DIR --listen {}", server);
  }
  if (json) {
    Json error = {{"code", absl::StatusCodeToString(status.code())},
                  {"reason", ReasonOf(status)},
                  {"subject", SubjectOf(status)},
                  {"message", message},
                  {"exit_code", static_cast<int>(code)}};
    if (!hint.empty()) {
      error["hint"] = hint;
    }
    fmt::print(stderr, "{}\n", Json{{"error", error}}.dump(-1, ' ', false, Json::error_handler_t::replace));
    return;
  }
  fmt::print(stderr, "tessera: {}\n", message);
  if (!hint.empty()) {
    fmt::print(stderr, "{}\n", hint);
  }
}

}  // namespace tessera::cli
