// tessera completion bash
#include "client/cli/completion.h"

#include <fmt/format.h>

#include "client/cli/commands.h"

namespace tessera::cli {
namespace {

// Everything that may follow `command`: its subcommands, its options and those of the commands above it.
std::string WordsAfter(const CLI::App& command) {
  std::string words;
  for (const CLI::App* sub : command.get_subcommands([](const CLI::App*) { return true; })) {
    words += fmt::format("{} ", sub->get_name());
  }
  for (const CLI::App* from = &command; from != nullptr; from = from->get_parent()) {
    for (const CLI::Option* option : from->get_options()) {
      for (const std::string& name : option->get_lnames()) {
        words += fmt::format("--{} ", name);
      }
      for (const std::string& name : option->get_snames()) {
        words += fmt::format("-{} ", name);
      }
    }
  }
  words.pop_back();
  return words;
}

void AppendCases(const CLI::App& command, const std::string& path, std::string& cases) {
  cases += fmt::format("    '{}') words='{}' ;;\n", path, WordsAfter(command));
  for (const CLI::App* sub : command.get_subcommands([](const CLI::App*) { return true; })) {
    AppendCases(*sub, path.empty() ? sub->get_name() : fmt::format("{} {}", path, sub->get_name()), cases);
  }
}

// Longest known path of commands among the words typed so far, options and their values skipped.
constexpr char kScript[] = R"(# bash completion for tessera:  source <(tessera completion bash)
_tessera_words() {{
  case "$1" in
{}    *) return 1 ;;
  esac
}}
_tessera() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} path='' words='' i
  for ((i = 1; i < COMP_CWORD; i++)); do
    if _tessera_words "${{path:+$path }}${{COMP_WORDS[i]}}"; then
      path="${{path:+$path }}${{COMP_WORDS[i]}}"
    fi
  done
  _tessera_words "$path"
  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")
}}
complete -o default -F _tessera tessera
)";

}  // namespace

std::string BashCompletion(const CLI::App& app) {
  std::string cases;
  AppendCases(app, "", cases);
  return fmt::format(kScript, cases);
}

void AddCompletionCommand(CLI::App& app, Session& session) {
  CLI::App* noun = app.add_subcommand("completion", "Shell completion");
  noun->require_subcommand(1);
  CLI::App* bash = noun->add_subcommand("bash", "A script for bash: source <(tessera completion bash)");
  bash->callback([&app, &session] {
    session.run = [&app, &session] {
      const std::string script = BashCompletion(app);
      session.Answer({{"shell", "bash"}, {"script", script}}, script);
      return absl::OkStatus();
    };
  });
}

}  // namespace tessera::cli
