#include "server/catalog/connections.h"

#include <cerrno>
#include <fstream>

#include <gtest/gtest.h>

#include "proto/wire/status.h"
#include "server/catalog/migrations.h"
#include "server/catalog/resources.h"
#include "server/catalog/storage_error.h"
#include "tests/server/support/open_catalog.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

absl::StatusOr<std::string> Scalar(Database& db, std::string_view sql) {
  TESSERA_ASSIGN_OR_RETURN(Statement row, db.Query(sql));
  TESSERA_RETURN_IF_ERROR(row.Step().status());
  return row.Text(0);
}

TEST(ConnectionsTest, TheWriterIsDurableAndTablesAreStrict) {
  TempFolder folder;
  OpenCatalog catalog(folder.path());
  ASSERT_TRUE(
      catalog.connections
          ->Write([](Database& db) -> absl::Status {
            EXPECT_EQ(*Scalar(db, "PRAGMA journal_mode"), "wal");
            EXPECT_EQ(*Scalar(db, "PRAGMA synchronous"), "2");
            EXPECT_EQ(*Scalar(db, "PRAGMA foreign_keys"), "1");
            EXPECT_EQ(
                *Scalar(db,
                        "SELECT count(*) FROM pragma_table_list WHERE schema = 'main' AND type = 'table'"
                        " AND NOT strict AND name NOT LIKE 'sqlite_%'"),
                "0");
            return absl::OkStatus();
          })
          .ok());
}

TEST(ConnectionsTest, AFailedWriteLeavesNothing) {
  TempFolder folder;
  OpenCatalog catalog(folder.path());
  const std::string insert = "INSERT INTO requests VALUES ('id', 'hash', x'00', 1)";
  EXPECT_FALSE(catalog.connections
                   ->Write([&](Database& db) -> absl::Status {
                     TESSERA_RETURN_IF_ERROR(db.Run(insert));
                     return absl::InternalError("no");
                   })
                   .ok());
  ASSERT_TRUE(catalog.connections
                  ->Read([](Database& db) -> absl::Status {
                    EXPECT_EQ(*Scalar(db, "SELECT count(*) FROM requests"), "0");
                    return absl::OkStatus();
                  })
                  .ok());
}

TEST(ConnectionsTest, ReadersCannotWrite) {
  TempFolder folder;
  OpenCatalog catalog(folder.path());
  const absl::Status status = catalog.connections->Read(
      [](Database& db) { return db.Run("INSERT INTO requests VALUES ('id', 'hash', x'00', 1)"); });
  EXPECT_EQ(ReasonOf(status), "STORAGE_READ_ONLY");
}

TEST(MigrationsTest, OlderCatalogsAreBroughtUpAndNewerOnesRefused) {
  TempFolder folder;
  auto db = Database::Open(folder.path() / "c.sqlite", OpenMode::kReadWrite);
  ASSERT_TRUE(db.ok()) << db.status();
  const std::string_view first[] = {"CREATE TABLE a (x INTEGER) STRICT;"};
  const std::string_view both[] = {first[0],
                                   "ALTER TABLE a ADD COLUMN y TEXT; INSERT INTO a VALUES (1, 'new');"};
  ASSERT_TRUE(Migrate(*db, first).ok());
  ASSERT_TRUE(Migrate(*db, both).ok());
  ASSERT_TRUE(Migrate(*db, both).ok());  // nothing left to do
  EXPECT_EQ(*Scalar(*db, "SELECT group_concat(y) FROM a"), "new");
  EXPECT_EQ(*Scalar(*db, "PRAGMA user_version"), "2");

  const absl::Status newer = Migrate(*db, first);
  EXPECT_EQ(newer.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(newer.message().find("schema version 2"), absl::string_view::npos) << newer;
}

TEST(MigrationsTest, TileSetsOfVersionTwoHaveNoThumbnail) {
  TempFolder folder;
  const std::string sha256(64, 'a');
  {
    auto db = Database::Open(folder.path() / "catalog.sqlite", OpenMode::kReadWrite);
    ASSERT_TRUE(db.ok()) << db.status();
    ASSERT_TRUE(Migrate(*db, SchemaScripts().first(2)).ok());
    ASSERT_TRUE(db->Run("INSERT INTO blobs VALUES (?, 1, x'00', 1)", sha256).ok());
    ASSERT_TRUE(db->Run("INSERT INTO tile_sets VALUES ('plane-16', 'wool', ?, 'x', 64, 16, 16, 9, 'dsh', '', "
                        "'', '', '', '', 1)",
                        sha256)
                    .ok());
  }
  OpenCatalog catalog(folder.path());
  const TileSetId id{"plane-16", "wool"};
  const auto old = catalog.Write<v1::TileSet>([&](Database& db) { return GetTileSet(db, id); });
  ASSERT_TRUE(old.ok()) << old.status();
  EXPECT_EQ(old->num_btfels(), 9u);
  EXPECT_FALSE(old->has_thumbnail());
  EXPECT_TRUE(
      catalog.connections->Write([&](Database& db) { return PutThumbnail(db, id, sha256, sha256, 2); }).ok());
}

TEST(MigrationsTest, AFailedMigrationChangesNothing) {
  TempFolder folder;
  auto db = Database::Open(folder.path() / "c.sqlite", OpenMode::kReadWrite);
  const std::string_view scripts[] = {
      "CREATE TABLE a (x INTEGER) STRICT; CREATE TABLE a (x INTEGER) STRICT;"};
  EXPECT_FALSE(Migrate(*db, scripts).ok());
  EXPECT_EQ(*Scalar(*db, "PRAGMA user_version"), "0");
  EXPECT_EQ(*Scalar(*db, "SELECT count(*) FROM sqlite_schema"), "0");
}

TEST(MigrationsTest, AServerDoesNotOpenANewerCatalog) {
  TempFolder folder;
  const auto file = folder.path() / "catalog.sqlite";
  {
    auto db = Database::Open(file, OpenMode::kReadWrite);
    ASSERT_TRUE(db->RunScript("PRAGMA user_version = 1000").ok());
  }
  EXPECT_EQ(Connections::Open(file).status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(StorageErrorTest, AFullDatabaseIsStorageFull) {
  TempFolder folder;
  OpenCatalog catalog(folder.path());
  const std::string big(1 << 20, 'x');
  const absl::Status status = catalog.connections->Write([&](Database& db) -> absl::Status {
    TESSERA_RETURN_IF_ERROR(db.RunScript("PRAGMA max_page_count = 60"));
    return db.Run("INSERT INTO requests VALUES ('id', 'hash', ?, 1)", BlobBytes{big});
  });
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(ReasonOf(status), "STORAGE_FULL");
}

TEST(StorageErrorTest, ADamagedCatalogIsDataLoss) {
  TempFolder folder;
  std::ofstream(folder.path() / "catalog.sqlite") << std::string(8192, 'x');
  EXPECT_EQ(Connections::Open(folder.path() / "catalog.sqlite").status().code(), absl::StatusCode::kDataLoss);
}

TEST(StorageErrorTest, SystemErrorsHaveStableReasons) {
  for (const int error : {ENOSPC, EDQUOT, EFBIG}) {
    EXPECT_EQ(ReasonOf(StatusFromErrno(error, "write")), "STORAGE_FULL");
  }
  for (const int error : {EROFS, EACCES, EPERM}) {
    EXPECT_EQ(ReasonOf(StatusFromErrno(error, "write")), "STORAGE_READ_ONLY");
  }
}

}  // namespace
}  // namespace tessera
