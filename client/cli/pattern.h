// What a material's pattern is, in words.
#pragma once

#include <string>

#include "client/cli/session.h"

namespace tessera::cli {

// One line on anisotropy, feature size and period, from `pattern` of a tile set's metadata
// (btf/tiles/pattern.h); figures that are missing are left out, so it may be empty.
[[nodiscard]] std::string PatternText(const Json& pattern);

}  // namespace tessera::cli
