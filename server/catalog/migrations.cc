#include "server/catalog/migrations.h"

#include <absl/strings/str_cat.h>

namespace tessera {
namespace {

absl::StatusOr<int64_t> UserVersion(Database& db) {
  TESSERA_ASSIGN_OR_RETURN(Statement query, db.Query("PRAGMA user_version"));
  TESSERA_RETURN_IF_ERROR(query.Step().status());
  return query.Int(0);
}

}  // namespace

absl::Status Migrate(Database& db, std::span<const std::string_view> scripts) {
  TESSERA_ASSIGN_OR_RETURN(const int64_t version, UserVersion(db));
  if (version < 0 || version > static_cast<int64_t>(scripts.size())) {
    return absl::FailedPreconditionError(absl::StrCat("the catalog has schema version ", version,
                                                      ", this program knows versions up to ", scripts.size(),
                                                      ": run a newer tessera-server on this data folder"));
  }
  for (size_t next = static_cast<size_t>(version); next < scripts.size(); ++next) {
    const std::string script = absl::StrCat("BEGIN IMMEDIATE;\n", std::string(scripts[next]),
                                            "\nPRAGMA user_version = ", next + 1, ";\nCOMMIT;");
    if (absl::Status status = db.RunScript(script); !status.ok()) {
      if (db.in_transaction()) {
        db.RunScript("ROLLBACK").IgnoreError();
      }
      return status;
    }
  }
  return absl::OkStatus();
}

}  // namespace tessera
