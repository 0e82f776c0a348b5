// Through a real socket.
#include "server/rpc/jobs.h"

#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include "server/catalog/sqlite.h"
#include "tests/server/support/server_fixture.h"

namespace tessera {
namespace {

constexpr milliseconds kCancelLimit{1000};

TEST_F(ServerTest, AWatchFollowsAJobAndResumes) {
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  WaitForRun(job->name());
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(job->name());
  auto reader = stubs_->jobs->WatchJob(&context, request);
  v1::JobEvent event;
  uint64_t sequence = 0;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(reader->Read(&event));
    EXPECT_GT(event.sequence(), sequence);
    sequence = event.sequence();
  }
  EXPECT_EQ(event.job().progress().stage(), "sleep");

  grpc::ClientContext resumed_context;
  request.set_after_sequence(sequence);
  auto resumed = stubs_->jobs->WatchJob(&resumed_context, request);
  ASSERT_TRUE(stubs_->Cancel(job->name()).ok());
  while (resumed->Read(&event)) {
    EXPECT_GT(event.sequence(), sequence);
    sequence = event.sequence();
  }
  EXPECT_TRUE(resumed->Finish().ok());
  EXPECT_EQ(event.job().state(), v1::Job::CANCELLED);
  while (reader->Read(&event)) {
  }
  EXPECT_TRUE(reader->Finish().ok());
  EXPECT_EQ(event.job().state(), v1::Job::CANCELLED);

  grpc::ClientContext late_context;  // everything was told: the stream ends at once
  request.set_after_sequence(sequence);
  auto late = stubs_->jobs->WatchJob(&late_context, request);
  EXPECT_FALSE(late->Read(&event));
  EXPECT_TRUE(late->Finish().ok());

  grpc::ClientContext unknown_context;
  request.set_name("jobs/99");
  auto unknown = stubs_->jobs->WatchJob(&unknown_context, request);
  EXPECT_FALSE(unknown->Read(&event));
  EXPECT_EQ(ReasonOf(StatusFromGrpc(unknown->Finish())), "NOT_FOUND");
}

TEST_F(ServerTest, ManyWatchersTakeNoThreads) {
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  v1::WatchJobRequest request;
  request.set_name(job->name());
  constexpr int kWatchers = 300;  // more than the server has threads
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::JobEvent>>> readers;
  v1::JobEvent event;
  for (int i = 0; i < kWatchers; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    readers.push_back(stubs_->jobs->WatchJob(contexts.back().get(), request));
    ASSERT_TRUE(readers.back()->Read(&event)) << i;
  }
  const auto start = steady_clock::now();
  EXPECT_TRUE(stubs_->Cancel(job->name()).ok());
  EXPECT_LT(steady_clock::now() - start, kCancelLimit);
  for (auto& reader : readers) {
    while (reader->Read(&event)) {
    }
    EXPECT_TRUE(reader->Finish().ok());
    EXPECT_EQ(event.job().state(), v1::Job::CANCELLED);
  }
}

TEST_F(ServerTest, WaitsEndWithTheJobOrTheirTime) {
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  const auto start = steady_clock::now();
  const auto waited = stubs_->Wait(job->name(), 50);
  ASSERT_TRUE(waited.ok()) << waited.status();
  EXPECT_FALSE(waited->state() == v1::Job::CANCELLED);
  EXPECT_GE(steady_clock::now() - start, milliseconds(50));
  std::jthread canceller([&] {
    std::this_thread::sleep_for(milliseconds(100));
    EXPECT_TRUE(stubs_->Cancel(job->name()).ok());
  });
  EXPECT_EQ(stubs_->Wait(job->name())->state(), v1::Job::CANCELLED);
  EXPECT_EQ(stubs_->Wait(job->name(), 600'001).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(ReasonOf(stubs_->Wait("jobs/99").status()), "NOT_FOUND");
}

TEST_F(ServerTest, ACancelEndsAJobWithinASecond) {
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  WaitForRun(job->name());
  const auto start = steady_clock::now();
  ASSERT_TRUE(stubs_->Cancel(job->name()).ok());
  EXPECT_EQ(stubs_->Wait(job->name())->state(), v1::Job::CANCELLED);
  EXPECT_LT(steady_clock::now() - start, kCancelLimit);
  EXPECT_EQ(stubs_->Cancel(job->name())->state(), v1::Job::CANCELLED);
}

TEST_F(ServerTest, AClientThatWithdrawsLeavesTheJobToTheOthers) {
  v1::GenerateMaterialRequest request = Stubs::SmallMaterial("a", 2);
  request.set_request_id("first");
  const auto first = stubs_->Generate(request);
  ASSERT_TRUE(first.ok()) << first.status();
  request.set_request_id("second");
  ASSERT_EQ(stubs_->Generate(request)->name(), first->name());
  WaitForRun(first->name());
  v1::CancelJobRequest cancel;
  cancel.set_name(first->name());
  const auto withdraw = [&](const std::string& request_id) {
    cancel.set_withdrawn_request_id(request_id);
    return Stubs::Call(&v1::Jobs::Stub::CancelJob, *stubs_->jobs, cancel);
  };
  EXPECT_EQ(withdraw("first")->state(), v1::Job::RUNNING);
  EXPECT_EQ(stubs_->Wait(first->name(), 300)->state(), v1::Job::RUNNING);
  EXPECT_TRUE(withdraw("second").ok());
  EXPECT_EQ(stubs_->Wait(first->name())->state(), v1::Job::CANCELLED);
}

// Whoever waits learns that the catalog cannot tell the end, instead of waiting for ever.
TEST_F(ServerTest, WatchesAndWaitsEndWhenTheJobIsLost) {
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  WaitForRun(job->name());
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(job->name());
  auto reader = stubs_->jobs->WatchJob(&context, request);
  v1::JobEvent event;
  ASSERT_TRUE(reader->Read(&event));
  std::jthread waiter(
      [&] { EXPECT_EQ(stubs_->Wait(job->name()).status().code(), absl::StatusCode::kUnavailable); });
  std::this_thread::sleep_for(milliseconds(100));  // the wait has begun
  {
    auto catalog = Database::Open(folder_.path() / "catalog.sqlite", OpenMode::kReadWrite);
    ASSERT_TRUE(catalog.ok()) << catalog.status();
    ASSERT_TRUE(catalog->RunScript("DELETE FROM jobs").ok());
  }
  // The heartbeat finds the lease gone and stops the run.
  while (reader->Read(&event)) {
  }
  EXPECT_EQ(StatusFromGrpc(reader->Finish()).code(), absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace tessera
