// The schema of the catalog, brought from any older version to this program's.
#pragma once

#include <span>
#include <string_view>

#include <absl/status/status.h>

#include "server/catalog/sqlite.h"

namespace tessera {

// The scripts of schema/NNN_*.sql in order, embedded when the program is built; script i leads to version i
// + 1.
[[nodiscard]] std::span<const std::string_view> SchemaScripts();

// Runs the scripts that `db` (its user_version) lacks, each in a transaction of its own.
// Errors: FAILED_PRECONDITION naming both versions when the database was made by a newer program; storage
// errors.
[[nodiscard]] absl::Status Migrate(Database& db, std::span<const std::string_view> scripts);

}  // namespace tessera
