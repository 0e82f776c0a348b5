#include "server/command.h"

#include <csignal>
#include <cstdio>
#include <string>

#include <pthread.h>

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include "server/server.h"

namespace tessera {
namespace {

constexpr int kExitCannotStart = 1;
constexpr int kExitUsage = 2;

// Blocks the signals that stop the server in this thread and all that it starts; they are waited for.
sigset_t BlockStopSignals() {
  // A client or a disk quota must not end the process: writes then fail with an error code.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  sigset_t stop_signals;
  sigemptyset(&stop_signals);
  sigaddset(&stop_signals, SIGTERM);
  sigaddset(&stop_signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &stop_signals, nullptr);
  return stop_signals;
}

}  // namespace

int RunServerCommand(int argc, char** argv) {
  CLI::App app(
      "Serves materials, tile sets, dressings and previews from a data folder until SIGTERM or SIGINT.");
  ServerOptions options;
  std::string data_folder;
  app.add_option("--data", data_folder, "Data folder; created when missing")->required()->type_name("DIR");
  app.add_option("--listen", options.listen, "Address; port 0 takes a free one")
      ->type_name("HOST:PORT")
      ->capture_default_str();
  app.add_option("--workers", options.num_workers,
                 "Jobs run at once; 0: half the cores, at least 1 (each job may use every core)")
      ->type_name("N")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_flag("--insecure", options.insecure,
               "Allow an address that other machines reach, without TLS and login");
  app.set_version_flag("--version", "tessera-server " TESSERA_VERSION);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kExitUsage;
  }
  options.data_folder = data_folder;
  spdlog::set_default_logger(spdlog::stderr_logger_mt("tessera-server"));
  spdlog::flush_on(spdlog::level::info);
  const sigset_t stop_signals = BlockStopSignals();

  const auto server = Server::Start(std::move(options));
  if (!server.ok()) {
    const auto message = server.status().message();
    std::fprintf(stderr, "tessera-server: %.*s\n", static_cast<int>(message.size()), message.data());
    return kExitCannotStart;
  }
  std::printf("listening on %s\n", (*server)->address().c_str());
  std::fflush(stdout);
  int signal = 0;
  sigwait(&stop_signals, &signal);
  spdlog::info("stopping: running jobs go back to the queue");
  (*server)->Stop();
  return 0;
}

}  // namespace tessera
