// The catalog's connections: one that writes, and owns every checkpoint, and read-only ones beside it.
//
// SQLite before 3.51.3 may damage a WAL when two connections checkpoint it at once; readers opened read-only
// never do.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/catalog/sqlite.h"

namespace tessera {

// Thread-safe.
class Connections {
 public:
  // Opens or creates the catalog file and migrates it. Errors: Migrate's and storage errors.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<Connections>> Open(const std::filesystem::path& file);
  // Writes the WAL back into the file.
  ~Connections();

  // Runs `body` in a write transaction: committed when it returns OK, rolled back otherwise. One at a time;
  // `body` must not call Write or Read.
  [[nodiscard]] absl::Status Write(const std::function<absl::Status(Database&)>& body);
  // Runs `body` in a read transaction, which sees one state of the catalog.
  [[nodiscard]] absl::Status Read(const std::function<absl::Status(Database&)>& body);

 private:
  Connections(std::filesystem::path file, Database writer)
      : file_(std::move(file)), writer_(std::move(writer)) {}

  std::filesystem::path file_;
  std::mutex writer_mutex_;
  Database writer_;  // guarded by writer_mutex_
  std::mutex readers_mutex_;
  std::vector<Database> idle_readers_;  // guarded by readers_mutex_
};

}  // namespace tessera
