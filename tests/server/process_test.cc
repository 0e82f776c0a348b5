// The real program: killed, stopped, short of space, kept from writing.
#include <chrono>
#include <thread>

#include <sys/resource.h>
#include <sys/stat.h>

#include <gtest/gtest.h>

#include "tests/server/support/child_server.h"
#include "tests/server/support/open_catalog.h"
#include "tests/server/support/stubs.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

using std::chrono::milliseconds;

// Work of a second or more, so that a signal finds it running.
v1::GenerateMaterialRequest LongJob(uint32_t size = 256) {
  v1::GenerateMaterialRequest request = Stubs::SmallMaterial("long");
  request.set_size(size);
  request.set_lights("ubo81");
  request.set_views("ubo81");
  request.mutable_encode()->set_kl(1);
  request.mutable_encode()->set_kv(1);
  return request;
}

void WaitForProgress(const Stubs& stubs, const std::string& job) {
  for (int i = 0; i < 4000; ++i) {
    const auto now = stubs.GetJob(job);
    ASSERT_TRUE(now.ok()) << now.status();
    if (now->state() == v1::Job::RUNNING && now->has_progress()) {
      return;
    }
    std::this_thread::sleep_for(milliseconds(5));
  }
  FAIL() << "the job did not start: " << stubs.GetJob(job)->DebugString();
}

TEST(ProcessTest, AnUploadSurvivesKill) {
  TempFolder folder;
  const std::string small = TestBytes(5'000, 1);
  const std::string large = TestBytes(40'000'000, 2);
  uint64_t acknowledged = 0;
  {
    ChildServer server(folder.path());
    const Stubs stubs(server.address());
    stubs.Upload(small);
    ASSERT_TRUE(stubs.BeginUpload(large).ok());
    acknowledged = stubs.Write(large, 0, 10'000'000)->committed_bytes();
    ASSERT_EQ(acknowledged, 10'000'000u);
    std::jthread uploading([&] { (void)stubs.Write(large, acknowledged, large.size() - 1); });
    std::this_thread::sleep_for(milliseconds(20));
    EXPECT_EQ(server.Stop(SIGKILL), -SIGKILL);
  }
  ChildServer server(folder.path());
  const Stubs stubs(server.address());
  EXPECT_EQ(*stubs.Download(DigestOf(small)), small);
  const auto status = stubs.BeginUpload(large);
  ASSERT_TRUE(status.ok()) << status.status();
  EXPECT_GE(status->committed_bytes(), acknowledged);
  const auto done = stubs.Write(large, status->committed_bytes(), large.size());
  ASSERT_TRUE(done.ok()) << done.status();
  EXPECT_TRUE(done->complete());
  EXPECT_EQ(*stubs.Download(DigestOf(large)), large);
}

TEST(ProcessTest, AJobSurvivesKillAndEnds) {
  TempFolder folder;
  std::string job;
  v1::Material made;
  {
    ChildServer server(folder.path());
    const Stubs stubs(server.address());
    const auto before = stubs.Generate(Stubs::SmallMaterial("before"));
    ASSERT_TRUE(before.ok()) << before.status();
    ASSERT_EQ(stubs.Wait(before->name())->state(), v1::Job::SUCCEEDED);
    made = *stubs.GetMaterial("before");
    const auto started = stubs.Generate(LongJob(64));
    ASSERT_TRUE(started.ok()) << started.status();
    job = started->name();
    WaitForProgress(stubs, job);
    EXPECT_EQ(server.Stop(SIGKILL), -SIGKILL);
  }
  ChildServer server(folder.path());
  const Stubs stubs(server.address());
  EXPECT_EQ(stubs.GetMaterial("before")->SerializeAsString(), made.SerializeAsString());
  EXPECT_EQ(stubs.Download(made.blob().sha256())->size(), made.blob().size_bytes());
  const auto ended = stubs.Wait(job);
  ASSERT_TRUE(ended.ok()) << ended.status();
  EXPECT_EQ(ended->state(), v1::Job::SUCCEEDED) << ended->DebugString();
  EXPECT_EQ(ended->attempt(), 2u);
  EXPECT_TRUE(stubs.GetMaterial("long").ok());
}

TEST(ProcessTest, AJobWhoseServerDiesThreeTimesFails) {
  TempFolder folder;
  std::string job;
  for (int attempt = 1; attempt <= 3; ++attempt) {
    ChildServer server(folder.path());
    const Stubs stubs(server.address());
    if (attempt == 1) {
      job = stubs.Generate(LongJob())->name();
    }
    WaitForProgress(stubs, job);
    server.Stop(SIGKILL);
  }
  ChildServer server(folder.path());
  const auto ended = Stubs(server.address()).GetJob(job);
  ASSERT_TRUE(ended.ok()) << ended.status();
  EXPECT_EQ(ended->state(), v1::Job::FAILED);
  EXPECT_EQ(ended->error().detail().reason(), "CRASHED");
}

TEST(ProcessTest, TermPutsJobsBack) {
  TempFolder folder;
  std::string job;
  {
    ChildServer server(folder.path());
    const Stubs stubs(server.address());
    job = stubs.Generate(LongJob())->name();
    WaitForProgress(stubs, job);
    EXPECT_EQ(server.Stop(SIGTERM), 0);
  }
  {
    OpenCatalog catalog(folder.path());
    const auto state = catalog.Write<std::string>([](Database& db) -> absl::StatusOr<std::string> {
      TESSERA_ASSIGN_OR_RETURN(Statement row, db.Query("SELECT state || attempt FROM jobs"));
      TESSERA_RETURN_IF_ERROR(row.Step().status());
      return row.Text(0);
    });
    EXPECT_EQ(*state, "QUEUED0");
  }
  ChildServer server(folder.path());
  const Stubs stubs(server.address());
  WaitForProgress(stubs, job);
  const auto start = std::chrono::steady_clock::now();
  ASSERT_TRUE(stubs.Cancel(job).ok());
  EXPECT_EQ(stubs.Wait(job)->state(), v1::Job::CANCELLED);
  EXPECT_LT(std::chrono::steady_clock::now() - start, milliseconds(1000));
}

// A limit on the size of files stands for a full disk: it needs no rights to set, and both end in the same
// code.
TEST(ProcessTest, AFullDiskIsSaidClearlyAndSurvived) {
  TempFolder folder;
  constexpr rlim_t kLimit = 3'000'000;
  ChildServer server(folder.path(), [] {
    const rlimit limit{kLimit, kLimit};
    setrlimit(RLIMIT_FSIZE, &limit);
  });
  ASSERT_NE(server.address(), "") << server.error_text();
  const Stubs stubs(server.address());
  const std::string fits = TestBytes(2'000'000, 1);
  const std::string too_large = TestBytes(5'000'000, 2);
  EXPECT_EQ(*stubs.Download(stubs.Upload(fits)), fits);
  ASSERT_TRUE(stubs.BeginUpload(too_large).ok());
  const auto refused = stubs.Write(too_large, 0, too_large.size());
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kResourceExhausted) << refused.status();
  EXPECT_EQ(ReasonOf(refused.status()), "STORAGE_FULL");
  EXPECT_EQ(refused.status().message().find(folder.path().string()), absl::string_view::npos);
  EXPECT_EQ(*stubs.Download(DigestOf(fits)), fits);
  // What fitted is kept, and the upload ends once there is room.
  const uint64_t committed = stubs.BeginUpload(too_large)->committed_bytes();
  EXPECT_GT(committed, 0u);
  server.Stop(SIGTERM);
  ChildServer roomy(folder.path());
  EXPECT_TRUE(Stubs(roomy.address()).Write(too_large, committed, too_large.size())->complete());
}

TEST(ProcessTest, AReadOnlyFolderIsSaidClearly) {
  TempFolder folder;
  std::filesystem::permissions(folder.path(), std::filesystem::perms(0555));
  constexpr uid_t kNobody = 65534;
  ChildServer server(folder.path(), [] {
    if (geteuid() == 0 && setuid(kNobody) != 0) {  // root may write anywhere
      _exit(126);
    }
  });
  EXPECT_EQ(server.address(), "");
  EXPECT_EQ(server.Wait(), 1);
  const std::string message = server.error_text();
  EXPECT_NE(message.find("cannot write its data folder"), std::string::npos) << message;
  EXPECT_NE(message.find(folder.path().string()), std::string::npos) << message;
  std::filesystem::permissions(folder.path(), std::filesystem::perms(0755));
}

TEST(ProcessTest, WrongOptionsAndOpenAddressesAreRefused) {
  TempFolder folder;
  ChildServer wrong(folder.path(), [] {}, {"--workers", "many"});
  EXPECT_EQ(wrong.Wait(), 2);
  ChildServer open(folder.path(), [] {}, {"--listen", "0.0.0.0:0"});
  EXPECT_EQ(open.Wait(), 1);
  EXPECT_NE(open.error_text().find("--insecure"), std::string::npos);
  ChildServer first(folder.path());
  ChildServer second(folder.path());
  EXPECT_EQ(second.Wait(), 1);
  EXPECT_NE(second.error_text().find("another tessera-server"), std::string::npos);
}

}  // namespace
}  // namespace tessera
