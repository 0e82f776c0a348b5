#include "server/catalog/job_table.h"

#include <gtest/gtest.h>

#include "proto/wire/status.h"
#include "tests/server/support/open_catalog.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

constexpr int64_t kLeaseMs = 1000;

class JobTableTest : public testing::Test {
 protected:
  absl::StatusOr<JobRecord> Insert(const std::string& name, const std::string& params,
                                   OnTaken on_taken = OnTaken::kRefuse) {
    return catalog_.Write<JobRecord>([&](Database& db) {
      return InsertJob(db, {"generate", 1, params, {}, name, on_taken}, catalog_.now_ms);
    });
  }
  std::optional<JobRecord> Claim(const std::string& lease) {
    auto claimed = catalog_.Write<std::optional<JobRecord>>(
        [&](Database& db) { return ClaimJob(db, lease, catalog_.now_ms + kLeaseMs, catalog_.now_ms); });
    EXPECT_TRUE(claimed.ok()) << claimed.status();
    return *claimed;
  }
  JobRecord Find(int64_t id) {
    return *catalog_.Write<JobRecord>([&](Database& db) { return FindJob(db, id); });
  }
  absl::Status Write(const std::function<absl::Status(Database&)>& body) {
    return catalog_.connections->Write(body);
  }
  std::vector<int64_t> Recover(int64_t lease_before_ms) {
    return *catalog_.Write<std::vector<int64_t>>(
        [&](Database& db) { return RecoverJobs(db, lease_before_ms, catalog_.now_ms); });
  }

  TempFolder folder_;
  OpenCatalog catalog_{folder_.path()};
};

TEST_F(JobTableTest, JobsAreClaimedOnceInOrder) {
  const auto first = Insert("materials/a", "1");
  const auto second = Insert("materials/b", "2");
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(first->job.state(), v1::Job::QUEUED);
  const auto claimed = Claim("x");
  ASSERT_TRUE(claimed);
  EXPECT_EQ(claimed->id, first->id);
  EXPECT_EQ(claimed->job.state(), v1::Job::RUNNING);
  EXPECT_EQ(claimed->job.attempt(), 1u);
  EXPECT_EQ(claimed->params, "1");
  EXPECT_GT(claimed->sequence, first->sequence);
  EXPECT_EQ(Claim("y")->id, second->id);
  EXPECT_FALSE(Claim("z"));
}

TEST_F(JobTableTest, OnlyTheLeaseHolderWrites) {
  const int64_t id = Insert("materials/a", "1")->id;
  ASSERT_TRUE(Claim("mine"));
  const auto end_with = [&](const std::string& lease) {
    return Write([&](Database& db) { return FailJob(db, id, lease, 9, absl::InternalError("x"), 1); });
  };
  EXPECT_TRUE(Write([&](Database& db) { return ExtendLease(db, id, "mine", 5); }).ok());
  EXPECT_EQ(Write([&](Database& db) { return ExtendLease(db, id, "other", 5); }).code(),
            absl::StatusCode::kAborted);
  EXPECT_EQ(Write([&](Database& db) { return FinishJob(db, id, "other", 9, {}, 1); }).code(),
            absl::StatusCode::kAborted);
  EXPECT_EQ(Write([&](Database& db) { return PutBackJob(db, id, "other", 9, 1); }).code(),
            absl::StatusCode::kAborted);
  EXPECT_EQ(end_with("other").code(), absl::StatusCode::kAborted);
  EXPECT_TRUE(end_with("mine").ok());
  EXPECT_EQ(end_with("mine").code(), absl::StatusCode::kAborted);  // it ended
  EXPECT_EQ(Find(id).job.state(), v1::Job::FAILED);
  EXPECT_EQ(Find(id).job.error().detail().reason(), "INTERNAL");
  EXPECT_EQ(Find(id).sequence, 9u);
}

TEST_F(JobTableTest, AWorkerThatDiesThreeTimesEndsTheJob) {
  const int64_t id = Insert("materials/a", "1")->id;
  uint64_t sequence = 0;
  for (int attempt = 1; attempt <= kMaxAttempts; ++attempt) {
    const auto claimed = Claim("lease" + std::to_string(attempt));
    ASSERT_TRUE(claimed) << attempt;
    EXPECT_EQ(claimed->job.attempt(), static_cast<uint32_t>(attempt));
    EXPECT_GT(claimed->sequence, sequence);
    sequence = claimed->sequence;
    EXPECT_TRUE(Recover(catalog_.now_ms + kLeaseMs).empty());  // the lease still holds
    EXPECT_EQ(Recover(catalog_.now_ms + kLeaseMs + 1), std::vector<int64_t>{id});
  }
  EXPECT_EQ(Find(id).job.state(), v1::Job::FAILED);
  EXPECT_EQ(Find(id).job.error().detail().reason(), "CRASHED");
  EXPECT_FALSE(Claim("again"));
}

TEST_F(JobTableTest, AJobHandedBackDoesNotCountItsAttempt) {
  const int64_t id = Insert("materials/a", "1")->id;
  for (int i = 0; i < 2 * kMaxAttempts; ++i) {
    const auto claimed = Claim("lease");
    ASSERT_TRUE(claimed);
    EXPECT_EQ(claimed->job.attempt(), 1u);
    ASSERT_TRUE(
        Write([&](Database& db) { return PutBackJob(db, id, "lease", claimed->sequence + 1, 1); }).ok());
  }
  EXPECT_EQ(Find(id).job.state(), v1::Job::QUEUED);
}

TEST_F(JobTableTest, CancelsEndQueuedJobsAndOutliveACrash) {
  const auto cancel = [&](int64_t id) {
    return *catalog_.Write<JobRecord>(
        [&](Database& db) { return RequestCancel(db, id, "", catalog_.now_ms); });
  };
  const int64_t queued = Insert("materials/a", "1")->id;
  EXPECT_EQ(cancel(queued).job.state(), v1::Job::CANCELLED);
  EXPECT_EQ(cancel(queued).job.state(), v1::Job::CANCELLED);
  const int64_t running = Insert("materials/b", "2")->id;
  ASSERT_TRUE(Claim("lease"));
  EXPECT_EQ(cancel(running).job.state(), v1::Job::RUNNING);
  EXPECT_TRUE(Find(running).cancel_requested);
  Recover(INT64_MAX);
  EXPECT_EQ(Find(running).job.state(), v1::Job::CANCELLED);
  EXPECT_EQ(
      catalog_.Write<JobRecord>([](Database& db) { return RequestCancel(db, 99, "", 1); }).status().code(),
      absl::StatusCode::kNotFound);
}

TEST_F(JobTableTest, EqualWorkForOneNameIsOneJob) {
  const auto first = Insert("materials/a", "1");
  EXPECT_EQ(Insert("materials/a", "1")->id, first->id);
  EXPECT_EQ(ReasonOf(Insert("materials/a", "2").status()), "NAME_TAKEN");
  EXPECT_NE(Insert("materials/a", "2", OnTaken::kReplace)->id, first->id);
}

TEST_F(JobTableTest, EqualWorkForTwoNamesRunsOnce) {
  const int64_t first = Insert("materials/a", "1")->id;
  const int64_t second = Insert("materials/b", "1")->id;
  ASSERT_NE(first, second);
  const auto claimed = Claim("x");
  ASSERT_EQ(claimed->id, first);
  EXPECT_FALSE(Claim("y")) << "equal work is running";
  const auto sha256 = catalog_.blobs->Put("result");
  ASSERT_TRUE(Write([&](Database& db) {
                return FinishJob(db, first, "x", 9, {*sha256, "message"}, 1);
              }).ok());
  const auto other = Claim("y");
  ASSERT_TRUE(other);
  EXPECT_EQ(other->id, second);
  const auto work = catalog_.Write<std::optional<FinishedWork>>(
      [&](Database& db) { return FindFinishedWork(db, other->dedupe_sha256); });
  ASSERT_TRUE(work.ok() && work->has_value());
  EXPECT_EQ((*work)->blob_sha256, *sha256);
  EXPECT_EQ((*work)->message, "message");
}

TEST_F(JobTableTest, InputsMustExistAndAreKeptUntilTheJobEnds) {
  const std::string bytes = TestBytes(100'000, 3);
  const auto sha256 = catalog_.blobs->Put(bytes);
  const auto insert = [&](const std::string& input) {
    return catalog_.Write<JobRecord>([&](Database& db) {
      return InsertJob(db, {"import", 1, "", {input}, "materials/a", OnTaken::kRefuse}, catalog_.now_ms);
    });
  };
  EXPECT_EQ(ReasonOf(insert(std::string(64, 'a')).status()), "BLOB_MISSING");
  const auto job = insert(*sha256);
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->inputs, std::vector<std::string>{*sha256});
  catalog_.now_ms += 2 * kUnnamedBlobKeptMs;
  ASSERT_TRUE(catalog_.blobs->CollectGarbage().ok());
  EXPECT_TRUE(catalog_.blobs->Get(*sha256).ok());
  ASSERT_TRUE(
      catalog_.Write<JobRecord>([&](Database& db) { return RequestCancel(db, job->id, "", 1); }).ok());
  ASSERT_TRUE(catalog_.blobs->CollectGarbage().ok());
  EXPECT_FALSE(catalog_.blobs->Get(*sha256).ok());
}

TEST_F(JobTableTest, ListsComeInPagesNewestFirst) {
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(Insert("materials/m" + std::to_string(i), std::to_string(i)).ok());
  }
  std::vector<std::string> names;
  std::string token;
  do {
    const auto page = ParsePage(kJobList, 2, token);
    ASSERT_TRUE(page.ok()) << page.status();
    const auto list = catalog_.Write<v1::ListJobsResponse>([&](Database& db) { return ListJobs(db, *page); });
    ASSERT_LE(list->jobs_size(), 2);
    for (const auto& job : list->jobs()) {
      names.push_back(job.name());
    }
    token = list->next_page_token();
  } while (!token.empty());
  EXPECT_EQ(names, (std::vector<std::string>{"jobs/5", "jobs/4", "jobs/3", "jobs/2", "jobs/1"}));
}

}  // namespace
}  // namespace tessera
