#include "server/catalog/sqlite.h"

#include <sqlite3.h>

#include "server/catalog/storage_error.h"

namespace tessera {
namespace {

constexpr int kLockWaitMs = 10'000;
constexpr std::string_view kAction = "use the catalog";

}  // namespace

void Statement::Finalize::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

absl::StatusOr<bool> Statement::Step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) {
    return true;
  }
  if (code == SQLITE_DONE) {
    return false;
  }
  return StatusFromSqlite(sqlite3_db_handle(statement_.get()), kAction);
}

int64_t Statement::Int(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

std::string Statement::Text(int column) const {
  return std::string(Bytes(column));
}

std::string_view Statement::Bytes(int column) const {
  const void* data = sqlite3_column_blob(statement_.get(), column);
  const int size = sqlite3_column_bytes(statement_.get(), column);
  return data == nullptr ? std::string_view() : std::string_view(static_cast<const char*>(data), size);
}

bool Statement::IsNull(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL;
}

bool Statement::BindInt(int place, int64_t value) {
  return sqlite3_bind_int64(statement_.get(), place, value) == SQLITE_OK;
}

bool Statement::BindText(int place, std::string_view value) {
  // A null pointer would bind NULL, which an empty text is not.
  return sqlite3_bind_text64(statement_.get(), place, value.data() == nullptr ? "" : value.data(),
                             value.size(), SQLITE_TRANSIENT, SQLITE_UTF8) == SQLITE_OK;
}

bool Statement::BindBlob(int place, std::string_view value) {
  return sqlite3_bind_blob64(statement_.get(), place, value.data() == nullptr ? "" : value.data(),
                             value.size(), SQLITE_TRANSIENT) == SQLITE_OK;
}

void Database::Close::operator()(sqlite3* connection) const {
  sqlite3_close_v2(connection);
}

absl::StatusOr<Database> Database::Open(const std::filesystem::path& path, OpenMode mode) {
  const int access =
      mode == OpenMode::kReadOnly ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
  sqlite3* connection = nullptr;
  const int code = sqlite3_open_v2(path.c_str(), &connection, access | SQLITE_OPEN_NOMUTEX, nullptr);
  Database db(connection);
  if (connection == nullptr) {
    return absl::ResourceExhaustedError("no memory for a catalog connection");
  }
  if (code != SQLITE_OK) {
    return StatusFromSqlite(connection, "open the catalog");
  }
  sqlite3_extended_result_codes(connection, 1);
  sqlite3_busy_timeout(connection, kLockWaitMs);
  TESSERA_RETURN_IF_ERROR(db.RunScript("PRAGMA foreign_keys = ON; PRAGMA trusted_schema = OFF;"));
  if (mode == OpenMode::kReadWrite) {
    TESSERA_RETURN_IF_ERROR(db.RunScript("PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL;"));
  }
  return db;
}

absl::StatusOr<Statement> Database::Prepare(std::string_view sql) {
  sqlite3_stmt* statement = nullptr;
  if (sqlite3_prepare_v2(connection_.get(), sql.data(), static_cast<int>(sql.size()), &statement, nullptr) !=
      SQLITE_OK) {
    return Failure(kAction);
  }
  return Statement(statement);
}

absl::Status Database::RunScript(const std::string& sql) {
  if (sqlite3_exec(connection_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    return Failure(kAction);
  }
  return absl::OkStatus();
}

absl::Status Database::Failure(std::string_view action) const {
  return StatusFromSqlite(connection_.get(), action);
}

int64_t Database::changes() const {
  return sqlite3_changes64(connection_.get());
}

int64_t Database::last_insert_rowid() const {
  return sqlite3_last_insert_rowid(connection_.get());
}

bool Database::in_transaction() const {
  return sqlite3_get_autocommit(connection_.get()) == 0;
}

}  // namespace tessera
