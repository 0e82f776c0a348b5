#include "server/catalog/connections.h"

#include <optional>

#include "server/catalog/migrations.h"

namespace tessera {
namespace {

// Ends a transaction that was not committed, after an exception too; SQLite itself rolls back after some
// errors (disk full).
struct Rollback {
  Database& db;
  ~Rollback() {
    if (db.in_transaction()) {
      db.RunScript("ROLLBACK").IgnoreError();
    }
  }
};

absl::Status InTransaction(Database& db, const char* begin,
                           const std::function<absl::Status(Database&)>& body) {
  TESSERA_RETURN_IF_ERROR(db.RunScript(begin));
  const Rollback rollback{db};
  TESSERA_RETURN_IF_ERROR(body(db));
  return db.RunScript("COMMIT");
}

}  // namespace

absl::StatusOr<std::unique_ptr<Connections>> Connections::Open(const std::filesystem::path& file) {
  TESSERA_ASSIGN_OR_RETURN(Database writer, Database::Open(file, OpenMode::kReadWrite));
  TESSERA_RETURN_IF_ERROR(Migrate(writer, SchemaScripts()));
  return std::unique_ptr<Connections>(new Connections(file, std::move(writer)));
}

Connections::~Connections() {
  idle_readers_.clear();
  // A failure costs nothing: the WAL stays and is read at the next start.
  writer_.RunScript("PRAGMA wal_checkpoint(TRUNCATE)").IgnoreError();
}

absl::Status Connections::Write(const std::function<absl::Status(Database&)>& body) {
  const std::lock_guard lock(writer_mutex_);
  return InTransaction(writer_, "BEGIN IMMEDIATE", body);
}

absl::Status Connections::Read(const std::function<absl::Status(Database&)>& body) {
  std::optional<Database> reader;
  {
    const std::lock_guard lock(readers_mutex_);
    if (!idle_readers_.empty()) {
      reader = std::move(idle_readers_.back());
      idle_readers_.pop_back();
    }
  }
  if (!reader) {
    TESSERA_ASSIGN_OR_RETURN(Database opened, Database::Open(file_, OpenMode::kReadOnly));
    reader = std::move(opened);
  }
  const absl::Status status = InTransaction(*reader, "BEGIN", body);
  const std::lock_guard lock(readers_mutex_);
  idle_readers_.push_back(std::move(*reader));
  return status;
}

}  // namespace tessera
