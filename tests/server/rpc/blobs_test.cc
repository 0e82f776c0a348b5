// Through a real socket.
#include "server/rpc/blobs.h"

#include <atomic>
#include <chrono>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>

#include "tests/server/support/server_fixture.h"

namespace tessera {
namespace {

TEST_F(ServerTest, BlobsGoUpAndComeDown) {
  const std::string bytes = TestBytes(3'500'000, 1);
  EXPECT_EQ(stubs_->Write(bytes, 0, 10).status().code(), absl::StatusCode::kNotFound);
  EXPECT_FALSE(stubs_->BeginUpload(bytes)->complete());
  // A stream that ends early keeps what it brought.
  EXPECT_EQ(stubs_->Write(bytes, 0, 1'200'000)->committed_bytes(), 1'200'000u);
  EXPECT_EQ(stubs_->BeginUpload(bytes)->committed_bytes(), 1'200'000u);
  EXPECT_EQ(ReasonOf(stubs_->Write(bytes, 2'000'000, 2'000'001).status()), "OFFSET_MISMATCH");
  EXPECT_TRUE(stubs_->Write(bytes, 1'200'000, bytes.size())->complete());
  EXPECT_TRUE(stubs_->BeginUpload(bytes)->complete());
  EXPECT_EQ(*stubs_->Download(DigestOf(bytes)), bytes);
  EXPECT_EQ(*stubs_->Download(DigestOf(bytes), 3'000'000), bytes.substr(3'000'000));
  EXPECT_EQ(stubs_->Download(DigestOf(bytes), bytes.size() + 1).status().code(),
            absl::StatusCode::kOutOfRange);
  EXPECT_EQ(ReasonOf(stubs_->Download(std::string(64, 'a')).status()), "BLOB_MISSING");
}

TEST_F(ServerTest, AnUploadThatBreaksOffKeepsWhatCameThrough) {
  const std::string bytes = TestBytes(5'000'000, 2);
  ASSERT_TRUE(stubs_->BeginUpload(bytes).ok());
  {
    grpc::ClientContext context;
    v1::UploadStatus response;
    auto writer = stubs_->blobs->WriteBlob(&context, &response);
    v1::WriteChunk chunk;
    chunk.set_sha256(DigestOf(bytes));
    for (uint64_t offset = 0; offset < 3 << 20; offset += 1 << 20) {
      chunk.set_offset(offset);
      chunk.set_data(bytes.substr(offset, 1 << 20));
      ASSERT_TRUE(writer->Write(chunk));
    }
    const auto uploading = folder_.path() / "uploads" / DigestOf(bytes);
    for (int i = 0; i < 4000; ++i) {  // until something came through
      std::error_code error;
      if (std::filesystem::file_size(uploading, error) > 0 && !error) {
        break;
      }
      std::this_thread::sleep_for(milliseconds(5));
    }
    context.TryCancel();
    EXPECT_FALSE(writer->Finish().ok());
  }
  uint64_t committed = 0;
  for (int i = 0; i < 2000 && committed == 0; ++i) {  // the server notices the break a moment later
    std::this_thread::sleep_for(milliseconds(10));
    committed = stubs_->BeginUpload(bytes)->committed_bytes();
  }
  EXPECT_GT(committed, 0u);
  EXPECT_TRUE(stubs_->Write(bytes, committed, bytes.size())->complete());
}

TEST_F(ServerTest, TwoClientsUploadTheSameBlobAtOnce) {
  const std::string bytes = TestBytes(20'000'000, 3);
  ASSERT_TRUE(stubs_->BeginUpload(bytes).ok());
  std::atomic<int> num_complete = 0;
  {
    std::vector<std::jthread> clients;
    for (int i = 0; i < 2; ++i) {
      clients.emplace_back([&] {
        const auto done = Stubs(server_->address()).Write(bytes, 0, bytes.size());
        EXPECT_TRUE(done.ok()) << done.status();
        num_complete += done.ok() && done->complete() ? 1 : 0;
      });
    }
  }
  EXPECT_EQ(num_complete, 2);
  EXPECT_EQ(*stubs_->Download(DigestOf(bytes)), bytes);
}

TEST_F(ServerTest, UploadsOfTheWrongBytesAreRefused) {
  const std::string promised = TestBytes(1000, 4);
  ASSERT_TRUE(stubs_->BeginUpload(promised).ok());
  grpc::ClientContext context;
  v1::UploadStatus response;
  auto writer = stubs_->blobs->WriteBlob(&context, &response);
  v1::WriteChunk chunk;
  chunk.set_sha256(DigestOf(promised));
  chunk.set_data(TestBytes(1000, 5));
  writer->Write(chunk);
  writer->WritesDone();
  EXPECT_EQ(ReasonOf(StatusFromGrpc(writer->Finish())), "DIGEST_MISMATCH");

  v1::BeginUploadRequest too_large;
  too_large.set_sha256(std::string(64, 'a'));
  too_large.set_size_bytes(kTestMaxUploadBytes + 1);
  EXPECT_EQ(ReasonOf(Stubs::Call(&v1::Blobs::Stub::BeginUpload, *stubs_->blobs, too_large).status()),
            "UPLOAD_TOO_LARGE");
}

TEST_F(ServerTest, MessagesAreBounded) {
  v1::WriteChunk chunk;
  chunk.set_sha256(std::string(64, 'a'));
  const std::string bytes = TestBytes(3 << 20, 1);
  ASSERT_TRUE(stubs_->BeginUpload(bytes).ok());
  const auto write = [&](size_t size) {
    grpc::ClientContext context;
    v1::UploadStatus response;
    auto writer = stubs_->blobs->WriteBlob(&context, &response);
    v1::WriteChunk large;
    large.set_sha256(DigestOf(bytes));
    large.set_data(std::string(size, 'x'));
    writer->Write(large);
    writer->WritesDone();
    return StatusFromGrpc(writer->Finish());
  };
  EXPECT_EQ(ReasonOf(write((1 << 20) + 1)), "ARGUMENT_INVALID");
  EXPECT_FALSE(write(5 << 20).ok());
}

}  // namespace
}  // namespace tessera
