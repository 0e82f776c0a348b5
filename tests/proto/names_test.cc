#include "proto/wire/names.h"

#include <gtest/gtest.h>

#include "proto/wire/status.h"

namespace tessera {
namespace {

TEST(NamesTest, WhatIsMadeIsParsed) {
  EXPECT_EQ(*ParseMaterialName(MaterialName("wool-2")), "wool-2");
  EXPECT_EQ(*ParseJobName(JobName(17)), 17);
  EXPECT_EQ(*ParseArrangementName(ArrangementName("surface-96")), "surface-96");
  const TileSetId id{"surface-96", "wool"};
  EXPECT_EQ(TileSetName(id), "arrangements/surface-96/tileSets/wool");
  EXPECT_EQ(*ParseTileSetName(TileSetName(id)), id);
  EXPECT_EQ(ThumbnailName(id), "arrangements/surface-96/tileSets/wool/thumbnail");
  EXPECT_EQ(*ParseThumbnailName(ThumbnailName(id)), id);
  EXPECT_FALSE(ParseThumbnailName(TileSetName(id)).ok());
  EXPECT_FALSE(ParseTileSetName(ThumbnailName(id)).ok());
}

TEST(NamesTest, IllegalNamesAreRefused) {
  const std::string longest(63, 'a');
  EXPECT_TRUE(ParseMaterialName("materials/" + longest).ok());
  for (const std::string& id :
       {std::string(), longest + "a", std::string("Wool"), std::string("a/b"), std::string("a b"),
        std::string("a_b"), std::string("../x"), std::string("a\0b", 3), std::string("w\xc3\xb6")}) {
    const auto material = ParseMaterialName("materials/" + id);
    EXPECT_EQ(material.status().code(), absl::StatusCode::kInvalidArgument) << id;
    EXPECT_EQ(ReasonOf(material.status()), "NAME_INVALID") << id;
    EXPECT_FALSE(ParseTileSetName("arrangements/plane-16/tileSets/" + id).ok()) << id;
    EXPECT_FALSE(ParseTileSetName("arrangements/" + id + "/tileSets/wool").ok()) << id;
  }
  EXPECT_FALSE(ParseMaterialName("wool").ok());
  for (const char* job :
       {"jobs/", "jobs/0", "jobs/-1", "jobs/01", "jobs/1x", "jobs/99999999999999999999", "1"}) {
    EXPECT_FALSE(ParseJobName(job).ok()) << job;
  }
}

TEST(NamesTest, DigestsAreSixtyFourLowerCaseDigits) {
  EXPECT_TRUE(CheckDigest(std::string(64, 'a'), "blob_sha256").ok());
  EXPECT_FALSE(CheckDigest(std::string(63, 'a'), "blob_sha256").ok());
  EXPECT_FALSE(CheckDigest(std::string(64, 'A'), "blob_sha256").ok());
  EXPECT_EQ(SubjectOf(CheckDigest("", "blob_sha256")), "blob_sha256");
}

}  // namespace
}  // namespace tessera
