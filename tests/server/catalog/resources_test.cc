#include "server/catalog/resources.h"

#include <gtest/gtest.h>

#include "proto/wire/status.h"
#include "tests/server/support/open_catalog.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

class ResourcesTest : public testing::Test {
 protected:
  absl::StatusOr<v1::Material> Put(const std::string& name, const std::string& sha256, OnTaken on_taken) {
    v1::Material message;
    message.set_width(3);
    message.mutable_provenance()->set_licence("CC0");
    message.set_metadata_json("{}");
    return catalog_.Write<v1::Material>(
        [&](Database& db) { return PutMaterial(db, name, sha256, message, on_taken, catalog_.now_ms); });
  }
  absl::StatusOr<v1::TileSet> PutTiles(const TileSetId& id, const std::string& sha256) {
    return catalog_.Write<v1::TileSet>(
        [&](Database& db) { return PutTileSet(db, id, sha256, {}, OnTaken::kRefuse, catalog_.now_ms); });
  }

  TempFolder folder_;
  OpenCatalog catalog_{folder_.path()};
  std::string blob_ = *catalog_.blobs->Put("one");
  std::string other_blob_ = *catalog_.blobs->Put("two");
};

TEST_F(ResourcesTest, ANameIsTakenUnlessReplaced) {
  const auto first = Put("wool", blob_, OnTaken::kRefuse);
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->name(), "materials/wool");
  EXPECT_EQ(first->blob().size_bytes(), 3u);
  EXPECT_EQ(ReasonOf(Put("wool", other_blob_, OnTaken::kRefuse).status()), "NAME_TAKEN");
  ASSERT_TRUE(Put("wool", other_blob_, OnTaken::kReplace).ok());
  const auto now = catalog_.Write<v1::Material>([](Database& db) { return GetMaterial(db, "wool"); });
  EXPECT_EQ(now->blob().sha256(), other_blob_);
  EXPECT_EQ(now->provenance().licence(), "CC0");
  EXPECT_EQ(now->width(), 3u);
  EXPECT_EQ(ReasonOf(Put("silk", std::string(64, 'a'), OnTaken::kRefuse).status()), "BLOB_MISSING");
}

TEST_F(ResourcesTest, ADeletedNamesBlobStaysForADay) {
  ASSERT_TRUE(Put("wool", blob_, OnTaken::kRefuse).ok());
  catalog_.now_ms += 10 * kUnnamedBlobKeptMs;
  ASSERT_TRUE(catalog_.blobs->CollectGarbage().ok());
  EXPECT_TRUE(catalog_.blobs->Get(blob_).ok());
  EXPECT_FALSE(catalog_.blobs->Get(other_blob_).ok());
  ASSERT_TRUE(
      catalog_.connections->Write([&](Database& db) { return DeleteMaterial(db, "wool", catalog_.now_ms); })
          .ok());
  EXPECT_EQ(
      catalog_.connections->Write([&](Database& db) { return DeleteMaterial(db, "wool", catalog_.now_ms); })
          .code(),
      absl::StatusCode::kNotFound);
  ASSERT_TRUE(catalog_.blobs->CollectGarbage().ok());
  EXPECT_TRUE(catalog_.blobs->Get(blob_).ok());
  catalog_.now_ms += kUnnamedBlobKeptMs + 1;
  ASSERT_TRUE(catalog_.blobs->CollectGarbage().ok());
  EXPECT_FALSE(catalog_.blobs->Get(blob_).ok());
}

TEST_F(ResourcesTest, MaterialsComeInPagesByName) {
  for (const char* name : {"c", "a", "e", "b", "d"}) {
    ASSERT_TRUE(Put(name, blob_, OnTaken::kRefuse).ok());
  }
  std::string names;
  std::string token;
  do {
    const auto page = ParsePage(kMaterialList, 2, token);
    ASSERT_TRUE(page.ok()) << page.status();
    const auto list =
        catalog_.Write<v1::ListMaterialsResponse>([&](Database& db) { return ListMaterials(db, *page); });
    for (const auto& material : list->materials()) {
      names += material.name().substr(10);
    }
    token = list->next_page_token();
  } while (!token.empty());
  EXPECT_EQ(names, "abcde");
}

TEST_F(ResourcesTest, TileSetsComeInPagesByArrangementAndName) {
  for (const TileSetId& id :
       {TileSetId{"surface-96", "b"}, TileSetId{"plane-16", "z"}, TileSetId{"plane-16", "a"},
        TileSetId{"plane-16-b", "a"}, TileSetId{"surface-96", "a"}}) {
    ASSERT_TRUE(PutTiles(id, blob_).ok());
  }
  const auto all = [&](const std::string& arrangement) {
    std::string names;
    std::string token;
    do {
      const auto page = ParsePage(TileSetList(arrangement), 1, token);
      const auto list = catalog_.Write<v1::ListTileSetsResponse>(
          [&](Database& db) { return ListTileSets(db, arrangement, *page); });
      for (const auto& tile_set : list->tile_sets()) {
        names += tile_set.name().substr(13) + " ";
      }
      token = list->next_page_token();
    } while (!token.empty());
    return names;
  };
  EXPECT_EQ(all("surface-96"), "surface-96/tileSets/a surface-96/tileSets/b ");
  EXPECT_EQ(all(""),
            "plane-16/tileSets/a plane-16/tileSets/z plane-16-b/tileSets/a surface-96/tileSets/a "
            "surface-96/tileSets/b ");
}

TEST_F(ResourcesTest, AThumbnailLivesAsLongAsItsTileSet) {
  const TileSetId id{"plane-16", "wool"};
  const std::string picture = *catalog_.blobs->Put("picture");
  const auto put_thumbnail = [&](const std::string& of) {
    return catalog_.connections->Write(
        [&](Database& db) { return PutThumbnail(db, id, of, picture, catalog_.now_ms); });
  };
  const auto get = [&] {
    return catalog_.Write<v1::TileSet>([&](Database& db) { return GetTileSet(db, id); });
  };
  EXPECT_TRUE(absl::IsNotFound(put_thumbnail(blob_)));
  ASSERT_TRUE(PutTiles(id, blob_).ok());
  EXPECT_FALSE(get()->has_thumbnail());
  EXPECT_TRUE(absl::IsFailedPrecondition(put_thumbnail(other_blob_)));
  ASSERT_TRUE(put_thumbnail(blob_).ok());
  EXPECT_EQ(get()->thumbnail().sha256(), picture);
  EXPECT_EQ(get()->thumbnail().size_bytes(), 7u);

  catalog_.now_ms += 10 * kUnnamedBlobKeptMs;
  ASSERT_TRUE(catalog_.blobs->CollectGarbage().ok());
  EXPECT_TRUE(catalog_.blobs->Get(picture).ok());

  // Another tile set under the name has another picture, or none yet; the old one stays for a day.
  ASSERT_TRUE(catalog_
                  .Write<v1::TileSet>([&](Database& db) {
                    return PutTileSet(db, id, blob_, {}, OnTaken::kReplace, catalog_.now_ms);
                  })
                  .ok());
  EXPECT_FALSE(get()->has_thumbnail());
  ASSERT_TRUE(put_thumbnail(blob_).ok());
  ASSERT_TRUE(
      catalog_.connections->Write([&](Database& db) { return DeleteTileSet(db, id, catalog_.now_ms); }).ok());
  ASSERT_TRUE(catalog_.blobs->CollectGarbage().ok());
  EXPECT_TRUE(catalog_.blobs->Get(picture).ok());
  catalog_.now_ms += kUnnamedBlobKeptMs + 1;
  ASSERT_TRUE(catalog_.blobs->CollectGarbage().ok());
  EXPECT_FALSE(catalog_.blobs->Get(picture).ok());
}

TEST_F(ResourcesTest, TokensBelongToOneList) {
  EXPECT_EQ(ParsePage("a", 0, "")->size, kDefaultPageSize);
  EXPECT_EQ(ParsePage("a", 5, PageToken("a", "key"))->after, "key");
  EXPECT_FALSE(ParsePage("b", 5, PageToken("a", "key")).ok());
  EXPECT_FALSE(ParsePage("a", 5, "nonsense!").ok());
  EXPECT_FALSE(ParsePage("a", kMaxPageSize + 1, "").ok());
}

TEST_F(ResourcesTest, AnswersAreRememberedWithTheirContent) {
  const auto find = [&](const std::string& id, const std::string& hash) {
    return catalog_.Write<std::optional<std::string>>([&](Database& db) { return FindAnswer(db, id, hash); });
  };
  EXPECT_FALSE(find("id", "hash")->has_value());
  ASSERT_TRUE(
      catalog_.connections
          ->Write([&](Database& db) { return RecordAnswer(db, "id", "hash", "answer", catalog_.now_ms); })
          .ok());
  EXPECT_EQ(**find("id", "hash"), "answer");
  EXPECT_EQ(find("id", "other").status().code(), absl::StatusCode::kInvalidArgument);
  ASSERT_TRUE(
      catalog_.connections
          ->Write([&](Database& db) { return ForgetOldAnswers(db, catalog_.now_ms + kRequestsKeptMs + 1); })
          .ok());
  EXPECT_FALSE(find("id", "hash")->has_value());
}

}  // namespace
}  // namespace tessera
