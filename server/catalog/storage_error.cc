#include "server/catalog/storage_error.h"

#include <cerrno>
#include <system_error>

#include <absl/strings/str_cat.h>
#include <absl/strings/string_view.h>
#include <sqlite3.h>

#include "proto/wire/status.h"

namespace tessera {
namespace {

absl::Status Describe(std::string_view action, const std::string& cause, int error) {
  const std::string message =
      absl::StrCat("cannot ", absl::string_view(action.data(), action.size()), ": ", cause);
  switch (error) {
    case ENOSPC:
    case EDQUOT:
    case EFBIG:
      return WithReason(
          absl::ResourceExhaustedError(absl::StrCat(message, "; the server's data folder is full")),
          "STORAGE_FULL");
    case EROFS:
    case EACCES:
    case EPERM:
      return WithReason(
          absl::FailedPreconditionError(absl::StrCat(message, "; the server cannot write its data folder")),
          "STORAGE_READ_ONLY");
    case EIO:
      return WithReason(absl::DataLossError(message), "BLOB_CORRUPT");
    default:
      return WithReason(absl::InternalError(message), "INTERNAL");
  }
}

}  // namespace

absl::Status StatusFromErrno(int error, std::string_view action) {
  return Describe(action, std::generic_category().message(error), error);
}

absl::Status StatusFromSqlite(sqlite3* connection, std::string_view action) {
  const int code = sqlite3_errcode(connection);
  const std::string cause = sqlite3_errmsg(connection);
  switch (code & 0xff) {
    case SQLITE_FULL:
      return Describe(action, cause, ENOSPC);
    case SQLITE_READONLY:
      return Describe(action, cause, EROFS);
    case SQLITE_CANTOPEN:
    case SQLITE_IOERR: {
      const int system_error = sqlite3_system_errno(connection);
      return Describe(action, cause, system_error == 0 || system_error == ENOENT ? EIO : system_error);
    }
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return Describe(action, cause, EIO);
    default:
      return Describe(action, cause, 0);
  }
}

}  // namespace tessera
