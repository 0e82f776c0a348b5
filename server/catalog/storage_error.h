// Failures of the file system and of SQLite as statuses with stable reasons. Messages say what was being done
// and never hold a path: they may reach a client.
//
// reason              code                 from
// STORAGE_FULL        RESOURCE_EXHAUSTED   ENOSPC, EDQUOT, EFBIG, SQLITE_FULL
// STORAGE_READ_ONLY   FAILED_PRECONDITION  EROFS, EACCES, EPERM, SQLITE_READONLY, SQLITE_CANTOPEN
// BLOB_CORRUPT        DATA_LOSS            EIO, SQLITE_CORRUPT, SQLITE_NOTADB
// INTERNAL            INTERNAL             anything else
#pragma once

#include <string_view>

#include <absl/status/status.h>

struct sqlite3;

namespace tessera {

// `action` completes "cannot ...", for example "write an upload".
[[nodiscard]] absl::Status StatusFromErrno(int error, std::string_view action);
// Of the connection's last failed call.
[[nodiscard]] absl::Status StatusFromSqlite(sqlite3* connection, std::string_view action);

}  // namespace tessera
