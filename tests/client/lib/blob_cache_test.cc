#include "client/lib/blob_cache.h"

#include <span>
#include <thread>

#include <gtest/gtest.h>

#include "btf/base/atomic_file.h"
#include "btf/base/sha256.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

std::string DigestOf(const std::string& bytes) {
  return Sha256Hex(std::as_bytes(std::span(bytes)));
}

void Put(const BlobCache& cache, const std::string& bytes) {
  auto partial = cache.Begin(DigestOf(bytes));
  ASSERT_TRUE(partial.ok()) << partial.status();
  ASSERT_TRUE(partial->Append(bytes).ok());
  ASSERT_TRUE(cache.Finish(*std::move(partial), DigestOf(bytes)).ok());
}

TEST(BlobCacheTest, GivesBackWhatWasPut) {
  const TempFolder folder;
  const BlobCache cache(folder.path());
  EXPECT_FALSE(cache.Read(DigestOf("tiles")).has_value());
  Put(cache, "tiles");
  EXPECT_EQ(cache.Read(DigestOf("tiles")), "tiles");
}

TEST(BlobCacheTest, DropsAFileThatDoesNotMatchItsName) {
  const TempFolder folder;
  const BlobCache cache(folder.path());
  Put(cache, "tiles");
  const std::string digest = DigestOf("tiles");
  const fs::path path = folder.path() / "blobs" / digest.substr(0, 2) / digest;
  ASSERT_TRUE(WriteFileAtomically(path, "tilez").ok());
  EXPECT_FALSE(cache.Read(digest).has_value());
  EXPECT_FALSE(fs::exists(path));
}

TEST(BlobCacheTest, ContinuesAPartialDownloadAndLetsOnlyOneWrite) {
  const TempFolder folder;
  const BlobCache cache(folder.path());
  const std::string digest = DigestOf("tiles");
  {
    auto first = cache.Begin(digest);
    ASSERT_TRUE(first.ok());
    ASSERT_TRUE(first->Append("til").ok());
    EXPECT_TRUE(absl::IsAborted(cache.Begin(digest).status()));
  }
  auto second = cache.Begin(digest);
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_EQ(second->ReadAll().value(), "til");
  ASSERT_TRUE(second->Append("es").ok());
  ASSERT_TRUE(cache.Finish(*std::move(second), digest).ok());
  EXPECT_EQ(cache.Read(digest), "tiles");
}

TEST(BlobCacheTest, DropsTheLongestUnusedBeyondItsLimit) {
  const TempFolder folder;
  const BlobCache cache(folder.path(), /*limit_bytes=*/8);
  const auto wait = [] { std::this_thread::sleep_for(std::chrono::milliseconds(20)); };
  Put(cache, "aaaa");
  wait();
  Put(cache, "bbbb");
  wait();
  EXPECT_TRUE(cache.Read(DigestOf("aaaa")).has_value());  // used: now younger than bbbb
  wait();
  Put(cache, "cccc");
  EXPECT_TRUE(cache.Read(DigestOf("aaaa")).has_value());
  EXPECT_FALSE(cache.Read(DigestOf("bbbb")).has_value());
  EXPECT_TRUE(cache.Read(DigestOf("cccc")).has_value());
}

TEST(BlobCacheTest, TakesOnlyDigestsForNames) {
  const TempFolder folder;
  const BlobCache cache(folder.path());
  EXPECT_TRUE(absl::IsInvalidArgument(cache.Begin("../../etc/passwd").status()));
  EXPECT_FALSE(cache.Read("../../etc/passwd").has_value());
}

}  // namespace
}  // namespace tessera
