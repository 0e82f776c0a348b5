#include "client/lib/client.h"

#include <chrono>
#include <cstdlib>
#include <span>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/atomic_file.h"
#include "btf/base/rng.h"
#include "btf/base/sha256.h"
#include "proto/wire/status.h"
#include "tests/client/lib/fake_server.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

using testing::ElementsAre;

// Pseudo-random, so that shifted or repeated chunks show.
std::string TestBytes(size_t size) {
  std::string bytes(size, '\0');
  Rng rng(7);
  for (char& byte : bytes) {
    byte = static_cast<char>(rng.Next());
  }
  return bytes;
}

std::span<const std::byte> BytesOf(const std::string& text) {
  return std::as_bytes(std::span(text));
}

v1::JobEvent Event(uint64_t sequence, v1::Job::State state, uint64_t done) {
  v1::JobEvent event;
  event.set_sequence(sequence);
  event.mutable_job()->set_name("jobs/1");
  event.mutable_job()->set_state(state);
  event.mutable_job()->mutable_progress()->set_stage("tiles");
  event.mutable_job()->mutable_progress()->set_done(done);
  event.mutable_job()->mutable_progress()->set_total(10);
  return event;
}

class ClientTest : public testing::Test {
 protected:
  void SetUp() override {
    auto client = Client::Connect({.address = server_.address(),
                                   .retry = {.max_attempts = 4, .first_wait_ms = 1, .longest_wait_ms = 5},
                                   .cache_folder = folder_.path() / "cache"});
    ASSERT_TRUE(client.ok()) << client.status();
    client_ = *std::move(client);
  }

  v1::Blob Serve(const std::string& bytes) {
    v1::Blob blob;
    blob.set_sha256(Sha256Hex(BytesOf(bytes)));
    blob.set_size_bytes(bytes.size());
    server_.blobs.blobs[blob.sha256()] = bytes;
    return blob;
  }

  FakeServer server_;
  TempFolder folder_;
  std::unique_ptr<Client> client_;
};

TEST(ClientConnectTest, SaysWhereThereIsNoServer) {
  const auto client = Client::Connect({.address = "127.0.0.1:1"});
  EXPECT_TRUE(absl::IsUnavailable(client.status())) << client.status();
  EXPECT_NE(client.status().message().find("127.0.0.1:1"), absl::string_view::npos);
}

TEST(ClientConnectTest, RefusesWhatIsNoAddress) {
  for (const char* address :
       {"", "localhost", ":7723", "localhost:", "localhost:0", "localhost:70000", "http://a:1"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(Client::Connect({.address = address}).status())) << address;
  }
}

TEST(ClientCacheTest, FolderFollowsTheEnvironment) {
  ::setenv("XDG_CACHE_HOME", "/var/somewhere", 1);
  EXPECT_EQ(DefaultCacheFolder(), "/var/somewhere/tessera");
  ::setenv("XDG_CACHE_HOME", "relative", 1);
  ::setenv("HOME", "/home/someone", 1);
  EXPECT_EQ(DefaultCacheFolder(), "/home/someone/.cache/tessera");
  ::unsetenv("XDG_CACHE_HOME");
  EXPECT_EQ(DefaultCacheFolder(), "/home/someone/.cache/tessera");
}

TEST_F(ClientTest, RepeatsAMutationWithTheSameRequestId) {
  server_.materials.failures = 2;
  v1::CreateMaterialRequest request;
  request.set_name("materials/wool");
  const auto material = client_->CreateMaterial(request);
  ASSERT_TRUE(material.ok()) << material.status();
  ASSERT_EQ(server_.materials.request_ids.size(), 3u);
  EXPECT_FALSE(server_.materials.request_ids[0].empty());
  EXPECT_EQ(server_.materials.request_ids[0], server_.materials.request_ids[2]);
  // Another call is another mutation.
  ASSERT_TRUE(client_->CreateMaterial(request).ok());
  EXPECT_NE(server_.materials.request_ids[0], server_.materials.request_ids[3]);
}

TEST_F(ClientTest, GivesUpAfterTheAttemptsItMayMake) {
  server_.materials.failures = 100;
  EXPECT_TRUE(absl::IsUnavailable(client_->CreateMaterial({}).status()));
  EXPECT_EQ(server_.materials.request_ids.size(), 4u);
}

TEST_F(ClientTest, StopEndsTheWaitBetweenAttempts) {
  auto patient = Client::Connect({.address = server_.address(), .retry = {.first_wait_ms = 60000}});
  ASSERT_TRUE(patient.ok());
  server_.materials.failures = 100;
  std::stop_source stop;
  std::jthread stopper([&stop] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    stop.request_stop();
  });
  const RunContext context{.stop = stop.get_token()};
  EXPECT_TRUE(absl::IsCancelled((*patient)->CreateMaterial({}, context).status()));
}

TEST_F(ClientTest, GathersEveryPage) {
  const auto materials = client_->ListMaterials();
  ASSERT_TRUE(materials.ok()) << materials.status();
  ASSERT_EQ(materials->size(), 6u);
  EXPECT_EQ(materials->back().name(), "materials/m5");
}

TEST_F(ClientTest, UploadContinuesWhereTheServerStands) {
  const std::string bytes = TestBytes((5 << 20) + 123);
  server_.blobs.failures = 2;
  server_.blobs.bytes_before_failure = 2 << 20;
  const auto blob = client_->UploadBytes(BytesOf(bytes));
  ASSERT_TRUE(blob.ok()) << blob.status();
  EXPECT_EQ(server_.blobs.blobs[blob->sha256()], bytes);
  EXPECT_THAT(server_.blobs.upload_offsets, ElementsAre(0, 2 << 20, 3 << 20));
}

TEST_F(ClientTest, UploadOfAFileAndOfNothing) {
  const std::string bytes = TestBytes(3 << 20);
  ASSERT_TRUE(WriteFileAtomically(folder_.path() / "mesh.obj", bytes).ok());
  const auto blob = client_->UploadFile(folder_.path() / "mesh.obj");
  ASSERT_TRUE(blob.ok()) << blob.status();
  EXPECT_EQ(server_.blobs.blobs[blob->sha256()], bytes);
  // Again: the server has it, nothing is sent.
  ASSERT_TRUE(client_->UploadFile(folder_.path() / "mesh.obj").ok());
  EXPECT_EQ(server_.blobs.upload_offsets.size(), 1u);

  const auto empty = client_->UploadBytes({});
  ASSERT_TRUE(empty.ok()) << empty.status();
  EXPECT_TRUE(server_.blobs.blobs.contains(empty->sha256()));
  EXPECT_TRUE(absl::IsNotFound(client_->UploadFile(folder_.path() / "none").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(client_->UploadFile(folder_.path()).status()));
}

TEST_F(ClientTest, DownloadContinuesAfterTheLastByte) {
  const std::string bytes = TestBytes(1 << 20);
  const v1::Blob blob = Serve(bytes);
  server_.blobs.failures = 3;
  server_.blobs.bytes_before_failure = 3 << 16;
  const auto read = client_->ReadBlob(blob);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(*read, bytes);
  EXPECT_THAT(server_.blobs.download_offsets, ElementsAre(0, 3 << 16, 6 << 16, 9 << 16));
}

TEST_F(ClientTest, DownloadWithAWrongDigestIsRefusedAndLeavesNoFile) {
  const v1::Blob blob = Serve(TestBytes(200000));
  server_.blobs.corrupt = true;
  EXPECT_TRUE(absl::IsDataLoss(client_->ReadBlob(blob).status()));
  EXPECT_TRUE(absl::IsDataLoss(client_->FetchBlob(blob).status()));
  EXPECT_TRUE(absl::IsDataLoss(client_->DownloadFile(blob, folder_.path() / "out")));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "out"));
  // The wrong bytes are not in the cache either.
  server_.blobs.corrupt = false;
  EXPECT_TRUE(client_->FetchBlob(blob).ok());
}

TEST_F(ClientTest, DownloadOfTheWrongSizeIsRefused) {
  v1::Blob blob = Serve(TestBytes(1000));
  blob.set_size_bytes(999);
  EXPECT_TRUE(absl::IsDataLoss(client_->ReadBlob(blob).status()));
  blob.set_size_bytes(1001);
  EXPECT_TRUE(absl::IsDataLoss(client_->ReadBlob(blob).status()));
}

TEST_F(ClientTest, FetchedBlobsAreDownloadedOnce) {
  const std::string bytes = TestBytes(300000);
  const v1::Blob blob = Serve(bytes);
  for (int i = 0; i < 3; ++i) {
    const auto fetched = client_->FetchBlob(blob);
    ASSERT_TRUE(fetched.ok()) << fetched.status();
    EXPECT_EQ(*fetched, bytes);
  }
  EXPECT_EQ(server_.blobs.download_offsets.size(), 1u);
}

TEST_F(ClientTest, FetchContinuesWhatAnEarlierClientLeft) {
  const std::string bytes = TestBytes(1 << 20);
  const v1::Blob blob = Serve(bytes);
  server_.blobs.failures = 100;
  server_.blobs.bytes_before_failure = 1 << 16;
  // Every attempt brings 64 KiB and counts as progress; stop after a while, as a killed process would.
  std::stop_source stop;
  uint64_t brought = 0;
  const RunContext context{.stop = stop.get_token(), .progress = [&](const Progress& progress) {
                             brought = progress.done;
                             if (brought >= (4u << 16)) {
                               stop.request_stop();
                             }
                           }};
  EXPECT_TRUE(absl::IsCancelled(client_->FetchBlob(blob, context).status()));
  server_.blobs.failures = 0;
  server_.blobs.download_offsets.clear();
  const auto fetched = client_->FetchBlob(blob);
  ASSERT_TRUE(fetched.ok()) << fetched.status();
  EXPECT_EQ(*fetched, bytes);
  EXPECT_THAT(server_.blobs.download_offsets, ElementsAre(brought));
}

TEST_F(ClientTest, FetchWorksWithoutACache) {
  ASSERT_TRUE(WriteFileAtomically(folder_.path() / "cache", "a file where the folder should be").ok());
  const std::string bytes = TestBytes(300000);
  EXPECT_EQ(client_->FetchBlob(Serve(bytes)).value(), bytes);
}

TEST_F(ClientTest, WatchShowsEveryEventOnceAcrossLostConnections) {
  for (uint64_t i = 1; i <= 7; ++i) {
    server_.jobs.events.push_back(Event(i, i == 7 ? v1::Job::SUCCEEDED : v1::Job::RUNNING, i));
  }
  server_.jobs.events_per_stream = 3;
  std::vector<uint64_t> seen;
  const auto job = client_->WatchJob(
      "jobs/1", 0, [&seen](const v1::JobEvent& event) { seen.push_back(event.sequence()); });
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->state(), v1::Job::SUCCEEDED);
  EXPECT_THAT(seen, ElementsAre(1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(server_.jobs.watched_after, ElementsAre(0, 3, 6));
}

TEST_F(ClientTest, WatchAfterTheLastEventReturnsTheJob) {
  server_.jobs.events = {Event(4, v1::Job::SUCCEEDED, 10)};
  const auto job = client_->WatchJob("jobs/1", 4, nullptr);
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->state(), v1::Job::SUCCEEDED);
}

TEST_F(ClientTest, AFailedJobIsToldFromAFailedCall) {
  v1::JobEvent failed = Event(1, v1::Job::FAILED, 3);
  failed.mutable_job()->mutable_error()->set_code(static_cast<int>(absl::StatusCode::kFailedPrecondition));
  failed.mutable_job()->mutable_error()->set_message("anisotropy 0.4, limit 0.2");
  failed.mutable_job()->mutable_error()->mutable_detail()->set_reason("NOT_ISOTROPIC");
  server_.jobs.events = {failed};
  const absl::Status status = client_->WaitForJob("jobs/1", OnStop::kCancelJob).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_EQ(FailedJob(status), "jobs/1");
  EXPECT_EQ(ReasonOf(status), "NOT_ISOTROPIC");
  EXPECT_EQ(FailedJob(absl::FailedPreconditionError("no job")), "");
}

TEST_F(ClientTest, StopCancelsTheJobOnlyWhenAsked) {
  server_.jobs.events = {Event(1, v1::Job::RUNNING, 3)};
  server_.jobs.endless = true;
  for (const OnStop on_stop : {OnStop::kLeaveJob, OnStop::kCancelJob}) {
    std::stop_source stop;
    const RunContext context{.stop = stop.get_token(),
                             .progress = [&stop](const Progress&) { stop.request_stop(); }};
    EXPECT_TRUE(absl::IsCancelled(client_->WaitForJob("jobs/1", on_stop, context).status()));
    EXPECT_EQ(server_.jobs.num_cancels, on_stop == OnStop::kCancelJob ? 1 : 0);
  }
}

TEST_F(ClientTest, StopWithdrawsTheCallsOfThisClientOnly) {
  server_.jobs.events = {Event(1, v1::Job::RUNNING, 3)};
  server_.jobs.endless = true;
  const auto stop_waiting = [&] {
    std::stop_source stop;
    const RunContext context{.stop = stop.get_token(),
                             .progress = [&stop](const Progress&) { stop.request_stop(); }};
    EXPECT_TRUE(absl::IsCancelled(client_->WaitForJob("jobs/1", OnStop::kCancelJob, context).status()));
    return server_.jobs.withdrawn_request_id;
  };
  ASSERT_EQ(client_->GenerateMaterial({})->name(), "jobs/1");
  EXPECT_EQ(stop_waiting(), server_.materials.request_ids.at(0));
  EXPECT_EQ(stop_waiting(), "");  // this client asks for it no more: it is someone else's job
}

}  // namespace
}  // namespace tessera
