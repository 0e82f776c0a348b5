// What every command shares: the global options, the connection, progress, and the two ways of answering.
#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/base/run_context.h"
#include "client/cli/progress_meter.h"
#include "client/lib/client.h"

namespace tessera::cli {

using Json = nlohmann::ordered_json;

class Session {
 public:
  explicit Session(std::stop_token stop);

  // Global options, filled by the parser.
  std::string server;  // HOST:PORT
  bool json = false;
  bool quiet = false;
  // What the parsed command does; set by the parser's callbacks.
  std::function<absl::Status()> run;

  // The connection, made on first use.
  [[nodiscard]] absl::StatusOr<Client*> Connect();
  // Stop requests and progress, for long work.
  [[nodiscard]] RunContext Context();
  // Times of the stages reported so far; ends the running one.
  std::vector<StageTime> FinishStages();
  [[nodiscard]] static Json JsonOfStages(const std::vector<StageTime>& stages);

  // The answer, on stdout: `value` with --json, else `text`, which ends without a line break.
  void Answer(const Json& value, std::string_view text) const;
  // One element of a stream of answers: compact JSON on a line, or `text`.
  void AnswerLine(const Json& value, std::string_view text) const;
  // A remark for people, on stderr, unless --quiet.
  void Note(std::string_view text);
  // A warning, on stderr.
  void Warn(std::string_view text);
  // The error that ends the program, on stderr: with --json one object on one line.
  void Fail(const absl::Status& status);

 private:
  [[nodiscard]] ProgressMeter& Meter();

  std::stop_token stop_;
  std::unique_ptr<Client> client_;
  std::unique_ptr<ProgressMeter> meter_;
};

}  // namespace tessera::cli
