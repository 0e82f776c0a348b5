// The command tessera-server: options, signals, exit codes.
#pragma once

namespace tessera {

// Serves until SIGTERM or SIGINT. Returns the exit code: 0 after a stop, 1 when the server cannot start, 2
// for wrong options.
[[nodiscard]] int RunServerCommand(int argc, char** argv);

}  // namespace tessera
