// One SQLite connection and its statements, with statuses for errors and typed parameters and columns.
//
//   TESSERA_ASSIGN_OR_RETURN(Statement rows, db.Query("SELECT name FROM materials WHERE width > ?", 64));
//   for (;;) {
//     TESSERA_ASSIGN_OR_RETURN(bool more, rows.Step());
//     if (!more) break;
//     Use(rows.Text(0));
//   }
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/status_macros.h"

struct sqlite3;
struct sqlite3_stmt;

namespace tessera {

// Marks bytes to be stored as BLOB instead of TEXT.
struct BlobBytes {
  std::string_view bytes;
};

// Columns count from 0. Not thread-safe.
class Statement {
 public:
  // True on a row, false at the end. Errors: see storage_error.h.
  [[nodiscard]] absl::StatusOr<bool> Step();

  [[nodiscard]] int64_t Int(int column) const;
  [[nodiscard]] std::string Text(int column) const;
  // TEXT or BLOB, as long as the row is current.
  [[nodiscard]] std::string_view Bytes(int column) const;
  [[nodiscard]] bool IsNull(int column) const;

 private:
  friend class Database;
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const;
  };
  explicit Statement(sqlite3_stmt* statement) : statement_(statement) {}

  [[nodiscard]] bool BindInt(int place, int64_t value);
  [[nodiscard]] bool BindText(int place, std::string_view value);
  [[nodiscard]] bool BindBlob(int place, std::string_view value);

  template <typename T>
  [[nodiscard]] bool Bind(int place, const T& value) {
    if constexpr (std::is_integral_v<T>) {
      return BindInt(place, static_cast<int64_t>(value));
    } else if constexpr (std::is_same_v<T, BlobBytes>) {
      return BindBlob(place, value.bytes);
    } else {
      return BindText(place, std::string_view(value));
    }
  }
  template <typename T>
  [[nodiscard]] bool Bind(int place, const std::optional<T>& value) {
    return !value || Bind(place, *value);  // an unbound parameter is NULL
  }

  std::unique_ptr<sqlite3_stmt, Finalize> statement_;
};

enum class OpenMode { kReadWrite, kReadOnly };

// Not thread-safe.
class Database {
 public:
  // kReadWrite creates the file and sets WAL, synchronous=FULL and foreign keys. Waits up to 10 s for locks.
  [[nodiscard]] static absl::StatusOr<Database> Open(const std::filesystem::path& path, OpenMode mode);

  // The statement with its parameters bound, in order. Bound bytes are copied.
  template <typename... Values>
  [[nodiscard]] absl::StatusOr<Statement> Query(std::string_view sql, const Values&... values) {
    TESSERA_ASSIGN_OR_RETURN(Statement statement, Prepare(sql));
    int place = 0;
    if (!(statement.Bind(++place, values) && ...)) {
      return Failure("bind a parameter");
    }
    return statement;
  }
  // Runs one statement to its end.
  template <typename... Values>
  [[nodiscard]] absl::Status Run(std::string_view sql, const Values&... values) {
    TESSERA_ASSIGN_OR_RETURN(Statement statement, Query(sql, values...));
    bool more = true;
    while (more) {
      TESSERA_ASSIGN_OR_RETURN(more, statement.Step());
    }
    return absl::OkStatus();
  }
  // Runs every statement of a script.
  [[nodiscard]] absl::Status RunScript(const std::string& sql);

  // Rows changed by the last INSERT, UPDATE or DELETE.
  [[nodiscard]] int64_t changes() const;
  [[nodiscard]] int64_t last_insert_rowid() const;
  // Whether a transaction is open; SQLite ends one by itself after some errors.
  [[nodiscard]] bool in_transaction() const;

 private:
  struct Close {
    void operator()(sqlite3* connection) const;
  };
  explicit Database(sqlite3* connection) : connection_(connection) {}
  [[nodiscard]] absl::StatusOr<Statement> Prepare(std::string_view sql);
  [[nodiscard]] absl::Status Failure(std::string_view action) const;

  std::unique_ptr<sqlite3, Close> connection_;
};

}  // namespace tessera
