// Messages of the service as JSON and as text.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/cli/session.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera::cli {

// Keys are those of tessera.proto, names are short, embedded JSON is an object. Stable: scripts rely on it.
[[nodiscard]] Json Describe(const v1::Material& material);
[[nodiscard]] Json Describe(const v1::Arrangement& arrangement);
[[nodiscard]] Json Describe(const v1::TileSet& tile_set);
[[nodiscard]] Json Describe(const v1::Job& job);
[[nodiscard]] Json Describe(const v1::ServerStatus& status);

// "RUNNING".
[[nodiscard]] std::string StateName(v1::Job::State state);
// One line: state, stage and how far.
[[nodiscard]] std::string JobLine(const v1::Job& job);

// Rows of equal length, the first of them headings, in columns; no trailing line break.
[[nodiscard]] std::string TextTable(const std::vector<std::vector<std::string>>& rows);
// "key: value" lines of a JSON object, nested keys with dots, empty values left out. Lists of sentences and
// of objects have a line for each, other long lists are counted.
[[nodiscard]] std::string TextRecord(const Json& object);

}  // namespace tessera::cli
