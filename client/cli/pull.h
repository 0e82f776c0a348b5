// tessera tileset pull: a whole tile set, or only what a scene needs of it.
#pragma once

#include <CLI/App.hpp>

#include "client/cli/session.h"

namespace tessera::cli {

void AddPull(CLI::App& noun, Session& session);

}  // namespace tessera::cli
