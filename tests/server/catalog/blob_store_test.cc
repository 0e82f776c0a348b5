#include "server/catalog/blob_store.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <fstream>
#include <thread>

#include <fcntl.h>
#include <gtest/gtest.h>

#include "proto/wire/status.h"
#include "tests/server/support/open_catalog.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

std::span<const std::byte> AsBytes(const std::string& text) {
  return std::as_bytes(std::span(text));
}

std::string Digest(const std::string& text) {
  return Sha256Hex(AsBytes(text));
}

size_t NumFiles(const std::filesystem::path& folder) {
  return std::distance(std::filesystem::directory_iterator(folder), {});
}

class BlobStoreTest : public testing::Test {
 protected:
  void Reopen() {
    catalog_.reset();
    catalog_ = std::make_unique<OpenCatalog>(folder_.path());
  }
  BlobStore& blobs() { return *catalog_->blobs; }
  std::filesystem::path blob_file(const std::string& sha256) { return folder_.path() / "blobs" / sha256; }

  // Uploads bytes [from, to) of `bytes` in chunks of `chunk`.
  absl::StatusOr<UploadProgress> Upload(const std::string& bytes, size_t from, size_t to, size_t chunk) {
    TESSERA_ASSIGN_OR_RETURN(UploadSession session, blobs().OpenUpload(Digest(bytes)));
    for (size_t offset = from; offset < to; offset += chunk) {
      const std::string part = bytes.substr(offset, std::min(chunk, to - offset));
      TESSERA_RETURN_IF_ERROR(session.Append(offset, AsBytes(part)));
    }
    return session.Commit();
  }

  TempFolder folder_;
  std::unique_ptr<OpenCatalog> catalog_ = std::make_unique<OpenCatalog>(folder_.path());
};

TEST_F(BlobStoreTest, SmallBlobsLieInTheCatalogLargeOnesInFiles) {
  for (const size_t size : {size_t{0}, size_t{1}, size_t{kMaxInlineBytes}, size_t{kMaxInlineBytes} + 1}) {
    const std::string bytes = TestBytes(size, size);
    const auto sha256 = blobs().Put(bytes);
    ASSERT_TRUE(sha256.ok()) << sha256.status();
    EXPECT_EQ(*sha256, Digest(bytes));
    EXPECT_EQ(*blobs().ReadAll(*sha256, 1 << 20), bytes);
    EXPECT_EQ(std::filesystem::exists(blob_file(*sha256)), size > kMaxInlineBytes) << size;
  }
  Reopen();
  EXPECT_TRUE(blobs().Get(Digest(TestBytes(kMaxInlineBytes + 1, kMaxInlineBytes + 1))).ok());
}

TEST_F(BlobStoreTest, MissingAndDamagedBlobsSaySo) {
  EXPECT_EQ(ReasonOf(blobs().Get(std::string(64, 'a')).status()), "BLOB_MISSING");
  const std::string bytes = TestBytes(100'000, 1);
  ASSERT_TRUE(blobs().Put(bytes).ok());
  EXPECT_EQ(blobs().ReadAll(Digest(bytes), 99'999).status().code(), absl::StatusCode::kResourceExhausted);
  std::filesystem::resize_file(blob_file(Digest(bytes)), 50'000);
  EXPECT_EQ(ReasonOf(blobs().Get(Digest(bytes)).status()), "BLOB_CORRUPT");
  std::filesystem::remove(blob_file(Digest(bytes)));
  EXPECT_EQ(ReasonOf(blobs().Get(Digest(bytes)).status()), "BLOB_CORRUPT");
}

TEST_F(BlobStoreTest, WhatACrashLeftIsSwept) {
  const std::string kept = TestBytes(100'000, 1);
  ASSERT_TRUE(blobs().Put(kept).ok());
  std::ofstream(folder_.path() / "blobs" / "new-7") << "half a blob";
  std::ofstream(blob_file(std::string(64, 'b'))) << "renamed, but its row was not written";
  std::ofstream(folder_.path() / "uploads" / std::string(64, 'c')) << "no row";
  std::filesystem::create_directories(folder_.path() / "scratch" / "3" / "deep");
  Reopen();
  EXPECT_EQ(NumFiles(folder_.path() / "blobs"), 1u);
  EXPECT_EQ(NumFiles(folder_.path() / "uploads"), 0u);
  EXPECT_EQ(NumFiles(folder_.path() / "scratch"), 0u);
  EXPECT_EQ(*blobs().ReadAll(Digest(kept), 1 << 20), kept);
}

TEST_F(BlobStoreTest, AnUploadGoesOnAfterACrash) {
  const std::string bytes = TestBytes(3'000'000, 5);
  ASSERT_TRUE(blobs().BeginUpload(Digest(bytes), bytes.size()).ok());
  const auto half = Upload(bytes, 0, 1'500'000, 1 << 20);
  ASSERT_TRUE(half.ok()) << half.status();
  EXPECT_EQ(half->committed_bytes, 1'500'000u);
  // Bytes that were written but never committed, as a crash leaves them.
  std::ofstream(folder_.path() / "uploads" / Digest(bytes), std::ios::app) << "torn write";
  Reopen();
  const auto again = blobs().BeginUpload(Digest(bytes), bytes.size());
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(again->committed_bytes, 1'500'000u);
  EXPECT_FALSE(again->complete);
  const auto whole = Upload(bytes, 1'500'000, bytes.size(), 1 << 20);
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_TRUE(whole->complete);
  EXPECT_EQ(*blobs().ReadAll(Digest(bytes), 1 << 24), bytes);
  EXPECT_TRUE(blobs().BeginUpload(Digest(bytes), bytes.size())->complete);
  EXPECT_EQ(NumFiles(folder_.path() / "uploads"), 0u);
}

TEST_F(BlobStoreTest, ACrashBetweenRenameAndRowLosesNothing) {
  const std::string bytes = TestBytes(200'000, 6);
  ASSERT_TRUE(blobs().BeginUpload(Digest(bytes), bytes.size()).ok());
  ASSERT_TRUE(Upload(bytes, 0, 150'000, 1 << 20).ok());
  std::filesystem::rename(folder_.path() / "uploads" / Digest(bytes), blob_file(Digest(bytes)));
  Reopen();
  const auto whole = Upload(bytes, 150'000, bytes.size(), 1 << 20);
  ASSERT_TRUE(whole.ok()) << whole.status();
  EXPECT_TRUE(whole->complete);
}

TEST_F(BlobStoreTest, LongUploadsAreCommittedOnTheWay) {
  const std::string bytes = TestBytes(kCommitIntervalBytes + 1'000'000, 7);
  ASSERT_TRUE(blobs().BeginUpload(Digest(bytes), bytes.size()).ok());
  auto session = blobs().OpenUpload(Digest(bytes));
  for (size_t offset = 0; offset < kCommitIntervalBytes; offset += 1 << 20) {
    ASSERT_TRUE(session->Append(offset, AsBytes(bytes).subspan(offset, 1 << 20)).ok());
  }
  EXPECT_EQ(blobs().BeginUpload(Digest(bytes), bytes.size())->committed_bytes, kCommitIntervalBytes);
}

TEST_F(BlobStoreTest, GapsAreRefusedAndKnownBytesSkipped) {
  const std::string bytes = TestBytes(10'000, 8);
  ASSERT_TRUE(blobs().BeginUpload(Digest(bytes), bytes.size()).ok());
  auto first = blobs().OpenUpload(Digest(bytes));
  auto second = blobs().OpenUpload(Digest(bytes));  // another client with the same bytes
  EXPECT_EQ(ReasonOf(first->Append(1, AsBytes(bytes).subspan(1, 10))), "OFFSET_MISMATCH");
  EXPECT_TRUE(first->Append(0, AsBytes(bytes).first(6'000)).ok());
  EXPECT_TRUE(second->Append(0, AsBytes(bytes).first(8'000)).ok());
  EXPECT_TRUE(first->Append(6'000, AsBytes(bytes).subspan(6'000)).ok());
  EXPECT_EQ(first->Append(9'999, AsBytes(bytes).first(2)).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(first->Commit()->complete);
  EXPECT_TRUE(second->Append(8'000, AsBytes(bytes).subspan(8'000)).ok());
  EXPECT_TRUE(second->Commit()->complete);
}

TEST_F(BlobStoreTest, AWrongDigestStartsAnew) {
  const std::string bytes = TestBytes(100'000, 9);
  ASSERT_TRUE(blobs().BeginUpload(Digest(bytes), bytes.size()).ok());
  {
    auto session = blobs().OpenUpload(Digest(bytes));
    ASSERT_TRUE(session->Append(0, AsBytes(TestBytes(100'000, 10))).ok());
    EXPECT_EQ(ReasonOf(session->Commit().status()), "DIGEST_MISMATCH");
    EXPECT_EQ(session->Commit().status().code(), absl::StatusCode::kAborted);
  }
  EXPECT_EQ(blobs().Get(Digest(bytes)).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(blobs().BeginUpload(Digest(bytes), bytes.size())->committed_bytes, 0u);
  EXPECT_TRUE(Upload(bytes, 0, bytes.size(), 1 << 20)->complete);
}

TEST_F(BlobStoreTest, UploadsAreBounded) {
  const std::string sha256(64, 'a');
  EXPECT_EQ(ReasonOf(blobs().BeginUpload(sha256, kTestMaxUploadBytes + 1).status()), "UPLOAD_TOO_LARGE");
  EXPECT_EQ(blobs().BeginUpload("abc", 1).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(blobs().OpenUpload(sha256).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ReasonOf(blobs().BeginUpload(sha256, 0).status()), "DIGEST_MISMATCH");
  EXPECT_TRUE(blobs().BeginUpload(Digest(""), 0)->complete);
}

TEST_F(BlobStoreTest, AnUploadThatCannotFitIsRefusedAtOnce) {
  const auto huge = std::filesystem::space(folder_.path()).capacity;
  auto store = BlobStore::Open(
      folder_.path(), *catalog_->connections, [] { return int64_t{0}; }, UINT64_MAX);
  EXPECT_EQ(ReasonOf((*store)->BeginUpload(std::string(64, 'a'), huge).status()), "STORAGE_FULL");
}

TEST_F(BlobStoreTest, UnusedBlobsGoAfterADay) {
  const std::string bytes = TestBytes(100'000, 11);
  ASSERT_TRUE(blobs().Put(bytes).ok());
  const auto handle = blobs().Get(Digest(bytes));
  ASSERT_TRUE(blobs().BeginUpload(std::string(64, 'a'), 5).ok());
  catalog_->now_ms += kUnnamedBlobKeptMs;
  ASSERT_TRUE(blobs().CollectGarbage().ok());
  EXPECT_TRUE(blobs().Get(Digest(bytes)).ok());
  catalog_->now_ms += 1;
  ASSERT_TRUE(blobs().CollectGarbage().ok());
  EXPECT_FALSE(blobs().Get(Digest(bytes)).ok());
  EXPECT_EQ(NumFiles(folder_.path() / "blobs"), 0u);
  EXPECT_FALSE(blobs().OpenUpload(std::string(64, 'a')).ok());
  std::string read(bytes.size(), '\0');  // a download that is under way is not cut
  EXPECT_TRUE((*handle)->ReadAt(0, std::as_writable_bytes(std::span(read))).ok());
  EXPECT_EQ(read, bytes);
}

TEST(FileTest, AFullDeviceIsStorageFull) {
  auto file = File::Open("/dev/full", O_WRONLY);
  ASSERT_TRUE(file.ok()) << file.status();
  const absl::Status status = file->WriteAt(0, AsBytes("bytes"));
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(ReasonOf(status), "STORAGE_FULL");
}

// A resumed upload is hashed first, which takes long when much of it is there.
TEST_F(BlobStoreTest, NoUploadWaitsForAnotherToBeHashed) {
  using std::chrono::steady_clock;
  constexpr int64_t kLargeBytes = int64_t{256} << 20;  // a sparse file: it takes no space
  const std::string large(64, 'a');
  ASSERT_TRUE(
      catalog_->connections
          ->Write([&](Database& db) {
            return db.Run(
                "INSERT INTO uploads (sha256, size_bytes, committed_bytes, touch_ms) VALUES (?, ?, ?, 0)",
                large, kLargeBytes + 1, kLargeBytes);
          })
          .ok());
  const std::filesystem::path file = folder_.path() / "uploads" / large;
  std::ofstream(file).close();
  std::filesystem::resize_file(file, kLargeBytes);
  const std::string small = TestBytes(10, 1);
  ASSERT_TRUE(blobs().BeginUpload(Digest(small), small.size()).ok());

  const auto start = steady_clock::now();
  std::atomic<bool> hashed = false;
  std::jthread resumed([&] {
    const auto session = blobs().OpenUpload(large);
    EXPECT_TRUE(session.ok()) << session.status();
    hashed = true;
  });
  steady_clock::duration longest{};
  while (!hashed) {
    const auto begin = steady_clock::now();
    ASSERT_TRUE(blobs().OpenUpload(Digest(small)).ok());
    longest = std::max(longest, steady_clock::now() - begin);
  }
  EXPECT_LT(longest * 2, steady_clock::now() - start);
}

}  // namespace
}  // namespace tessera
