#include "server/jobs/worker_pool.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <thread>

#include <gtest/gtest.h>
#include <spdlog/sinks/null_sink.h>

#include "proto/wire/names.h"
#include "proto/wire/status.h"
#include "tests/server/support/open_catalog.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

// Cancelled jobs end within a second, by the API's promise.
constexpr milliseconds kCancelLimit{1000};
constexpr std::chrono::seconds kPatience{20};

JobOutput OutputOf(const std::string& text) {
  if (text == "ugly" || text.starts_with("tiles")) {
    return {"blob of " + text, v1::TileSet()};
  }
  v1::Material message;
  message.set_codec(text);
  return {"blob of " + text, message};
}

// Parameters are the name of what to do.
absl::StatusOr<JobOutput> RunTestJob(const JobInput& input, const JobContext& context) {
  if (input.params.starts_with("sleep") || input.params.starts_with("deaf")) {
    const bool deaf = input.params.starts_with("deaf");
    const auto end = steady_clock::now() + std::chrono::seconds(deaf ? 2 : 60);
    for (uint64_t i = 0; steady_clock::now() < end; ++i) {
      if (!deaf) {
        TESSERA_RETURN_IF_ERROR(context.run.CheckStop());
      }
      context.run.Report("sleep", i, 0, "naps");
      std::this_thread::sleep_for(milliseconds(5));
    }
  }
  if (input.params.starts_with("fail")) {
    return WithReason(absl::FailedPreconditionError("anisotropy 0.7, at most 0.3"), "NOT_ISOTROPIC",
                      "materials/x");
  }
  if (input.params.starts_with("broken")) {
    // A result that throws when it is committed: the variant lost its value.
    struct Thrower {
      operator v1::Material() const { throw std::bad_alloc(); }
    };
    JobOutput output = OutputOf(input.params);
    try {
      output.resource.emplace<v1::Material>(Thrower());
    } catch (const std::bad_alloc&) {
    }
    return output;
  }
  if (input.params.starts_with("throw")) {
    throw std::bad_alloc();
  }
  return OutputOf(input.params);
}

class WorkerPoolTest : public testing::Test {
 protected:
  void StartPool(int num_workers) {
    pool_ = std::make_unique<WorkerPool>(
        *catalog_.connections, *catalog_.blobs, events_,
        std::vector<JobKind>{{"test", 1,
                              [this](const JobInput& input, const JobContext& context) {
                                ++num_runs_;
                                if (input.params == "vanish") {
                                  EXPECT_TRUE(DeleteJobs().ok());
                                }
                                return RunTestJob(input, context);
                              }},
                             {"update", 1,
                              [](const JobInput& input, const JobContext&) -> absl::StatusOr<JobOutput> {
                                return JobOutput{"blob of " + input.params, v1::TileSet()};
                              },
                              /*updates_result=*/true},
                             {std::string(kThumbnailKind), 1,
                              [this](const JobInput& input, const JobContext& context) {
                                return RunTestThumbnail(input, context);
                              }}},
        [this] { return catalog_.now_ms; },
        std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_mt>()));
    ASSERT_TRUE(pool_->Start(num_workers).ok());
  }
  absl::StatusOr<JobOutput> RunTestThumbnail(const JobInput& input, const JobContext& context) {
    TESSERA_ASSIGN_OR_RETURN(const std::string bytes, context.blobs->ReadAll(input.inputs.back(), 100));
    if (bytes == "blob of ugly") {
      return absl::InternalError("cannot be drawn");
    }
    return JobOutput{"picture of " + bytes, v1::TileSet()};
  }
  // A catalog that cannot tell any more what became of a job.
  absl::Status DeleteJobs() {
    return catalog_.connections->Write([](Database& db) { return db.RunScript("DELETE FROM jobs"); });
  }
  int64_t Insert(const std::string& name, const std::string& params, const std::string& kind = "test",
                 const std::string& request_id = "") {
    const auto record = catalog_.Write<JobRecord>([&](Database& db) {
      return InsertJob(db, {kind, 1, params, {}, name, OnTaken::kRefuse, request_id}, catalog_.now_ms);
    });
    EXPECT_TRUE(record.ok()) << record.status();
    if (pool_ != nullptr) {
      pool_->Wake();
    }
    return record->id;
  }
  v1::Job Find(int64_t id) {
    v1::Job job;
    EXPECT_TRUE(catalog_.connections
                    ->Read([&](Database& db) -> absl::Status {
                      TESSERA_ASSIGN_OR_RETURN(const JobRecord record, FindJob(db, id));
                      job = events_.EventOf(record).job();
                      return absl::OkStatus();
                    })
                    .ok());
    return job;
  }
  v1::Job WaitFor(int64_t id, const std::function<bool(const v1::Job&)>& condition) {
    const auto end = steady_clock::now() + kPatience;
    while (steady_clock::now() < end) {
      v1::Job job = Find(id);
      if (condition(job)) {
        return job;
      }
      std::this_thread::sleep_for(milliseconds(5));
    }
    ADD_FAILURE() << "waited in vain for " << Find(id).DebugString();
    return Find(id);
  }
  v1::Job WaitForEnd(int64_t id) {
    return WaitFor(id, [](const v1::Job& job) { return IsFinal(job.state()); });
  }
  void WaitForRun(int64_t id) {
    WaitFor(id, [](const v1::Job& job) { return job.state() == v1::Job::RUNNING && job.has_progress(); });
  }
  absl::StatusOr<v1::Material> Material(const std::string& name) {
    return catalog_.Write<v1::Material>([&](Database& db) { return GetMaterial(db, name); });
  }

  TempFolder folder_;
  OpenCatalog catalog_{folder_.path()};
  JobEvents events_;
  std::atomic<int> num_runs_ = 0;
  std::unique_ptr<WorkerPool> pool_;
};

TEST_F(WorkerPoolTest, AResultIsNamedWhenItsJobHasSucceeded) {
  StartPool(1);
  const int64_t id = Insert("materials/wool", "good");
  EXPECT_EQ(WaitForEnd(id).state(), v1::Job::SUCCEEDED);
  const auto material = Material("wool");
  ASSERT_TRUE(material.ok()) << material.status();
  EXPECT_EQ(material->codec(), "good");
  EXPECT_EQ(*catalog_.blobs->ReadAll(material->blob().sha256(), 100), "blob of good");
}

TEST_F(WorkerPoolTest, FailuresKeepTheirReason) {
  StartPool(2);
  const v1::Job refused = WaitForEnd(Insert("materials/a", "fail"));
  EXPECT_EQ(refused.state(), v1::Job::FAILED);
  EXPECT_EQ(refused.error().detail().reason(), "NOT_ISOTROPIC");
  EXPECT_EQ(refused.error().detail().subject(), "materials/x");
  EXPECT_EQ(refused.error().message(), "anisotropy 0.7, at most 0.3");
  EXPECT_EQ(WaitForEnd(Insert("materials/b", "throw")).error().code(),
            static_cast<int>(absl::StatusCode::kResourceExhausted));
  EXPECT_EQ(WaitForEnd(Insert("materials/c", "x", "unknown")).error().code(),
            static_cast<int>(absl::StatusCode::kUnimplemented));
  EXPECT_FALSE(Material("a").ok());
}

TEST_F(WorkerPoolTest, AResultThatCannotBeCommittedFailsItsJobOnly) {
  StartPool(1);
  const v1::Job broken = WaitForEnd(Insert("materials/a", "broken"));
  EXPECT_EQ(broken.state(), v1::Job::FAILED);
  EXPECT_EQ(broken.error().code(), static_cast<int>(absl::StatusCode::kInternal));
  EXPECT_EQ(WaitForEnd(Insert("materials/b", "good")).state(), v1::Job::SUCCEEDED);
}

TEST_F(WorkerPoolTest, WatchersAreToldWhenNobodyKnowsHowAJobEnded) {
  std::mutex mutex;
  std::condition_variable told;
  absl::Status error;
  const int64_t id = Insert("materials/a", "vanish");
  const uint64_t watch = events_.Watch(id, [&](const absl::StatusOr<v1::JobEvent>& event) {
    const std::lock_guard lock(mutex);
    error.Update(event.status());
    told.notify_all();
  });
  StartPool(1);
  {
    std::unique_lock lock(mutex);
    EXPECT_TRUE(told.wait_for(lock, kPatience, [&] { return !error.ok(); }));
    EXPECT_TRUE(absl::IsUnavailable(error)) << error;
  }
  events_.Unwatch(watch);
}

TEST_F(WorkerPoolTest, AJobThatNobodyHoldsRunsAgainAfterItsLease) {
  StartPool(1);
  const int64_t running = Insert("materials/x", "sleep");
  WaitForRun(running);
  const int64_t id = Insert("materials/a", "good");  // waits for the only worker
  ASSERT_TRUE(catalog_
                  .Write<std::optional<JobRecord>>([&](Database& db) {
                    return ClaimJob(db, "lease of a worker that could not record the end",
                                    catalog_.now_ms - 1, catalog_.now_ms);
                  })
                  .ok());
  ASSERT_TRUE(pool_->Cancel(running).ok());
  EXPECT_EQ(WaitForEnd(id).state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(WaitForEnd(running).state(), v1::Job::CANCELLED);
}

TEST_F(WorkerPoolTest, ASharedJobGoesOnUntilItsLastRequesterWithdraws) {
  StartPool(1);
  const int64_t id = Insert("materials/a", "sleep", "test", "first");
  EXPECT_EQ(Insert("materials/a", "sleep", "test", "second"), id);
  WaitForRun(id);
  for (int i = 0; i < 2; ++i) {  // said twice, it still speaks for the first caller alone
    const auto after = pool_->Cancel(id, "first");
    ASSERT_TRUE(after.ok()) << after.status();
    EXPECT_EQ(after->job.state(), v1::Job::RUNNING);
    EXPECT_FALSE(after->cancel_requested);
  }
  std::this_thread::sleep_for(kCancelLimit);
  EXPECT_EQ(Find(id).state(), v1::Job::RUNNING);
  ASSERT_TRUE(pool_->Cancel(id, "second").ok());
  EXPECT_EQ(WaitForEnd(id).state(), v1::Job::CANCELLED);
}

TEST_F(WorkerPoolTest, ACancelWithoutARequestEndsASharedJobForAll) {
  StartPool(1);
  const int64_t id = Insert("materials/a", "sleep", "test", "first");
  EXPECT_EQ(Insert("materials/a", "sleep"), id);
  WaitForRun(id);
  EXPECT_FALSE(pool_->Cancel(id, "first")->cancel_requested);
  ASSERT_TRUE(pool_->Cancel(id).ok());
  EXPECT_EQ(WaitForEnd(id).state(), v1::Job::CANCELLED);
}

TEST_F(WorkerPoolTest, ARunningJobIsCancelledWithinASecond) {
  StartPool(1);
  for (const char* params : {"sleep", "deaf"}) {
    const int64_t id = Insert("materials/wool", params);
    WaitForRun(id);
    const auto start = steady_clock::now();
    ASSERT_TRUE(pool_->Cancel(id).ok());
    EXPECT_EQ(WaitForEnd(id).state(), v1::Job::CANCELLED) << params;
    EXPECT_LT(steady_clock::now() - start, kCancelLimit) << params;
  }
  // The deaf one still makes its result, which is thrown away; the worker goes on.
  EXPECT_EQ(WaitForEnd(Insert("materials/silk", "good")).state(), v1::Job::SUCCEEDED);
  EXPECT_FALSE(Material("wool").ok());
}

TEST_F(WorkerPoolTest, AQueuedJobIsCancelledAtOnce) {
  StartPool(1);
  const int64_t running = Insert("materials/a", "sleep");
  WaitForRun(running);
  const int64_t queued = Insert("materials/b", "good");
  EXPECT_EQ(pool_->Cancel(queued)->job.state(), v1::Job::CANCELLED);
  EXPECT_EQ(pool_->Cancel(99).status().code(), absl::StatusCode::kNotFound);
}

TEST_F(WorkerPoolTest, AStoppingPoolHandsJobsBack) {
  StartPool(1);
  const int64_t id = Insert("materials/wool", "sleep");
  WaitForRun(id);
  pool_->Stop();
  EXPECT_EQ(Find(id).state(), v1::Job::QUEUED);
  EXPECT_EQ(Find(id).attempt(), 0u);
  StartPool(1);
  WaitForRun(id);
  EXPECT_EQ(Find(id).attempt(), 1u);
}

TEST_F(WorkerPoolTest, JobsOfADeadPoolRunAgain) {
  const int64_t id = Insert("materials/wool", "good");
  ASSERT_TRUE(catalog_
                  .Write<std::optional<JobRecord>>([&](Database& db) {
                    return ClaimJob(db, "lease of a process that was killed", catalog_.now_ms + 60'000,
                                    catalog_.now_ms);
                  })
                  .ok());
  StartPool(1);
  const v1::Job job = WaitForEnd(id);
  EXPECT_EQ(job.state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(job.attempt(), 2u);
}

TEST_F(WorkerPoolTest, EqualWorkIsDoneOnce) {
  StartPool(2);
  const int64_t first = Insert("materials/a", "good");
  const int64_t second = Insert("materials/b", "good");
  EXPECT_EQ(WaitForEnd(first).state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(WaitForEnd(second).state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(num_runs_, 1);
  EXPECT_EQ(Material("a")->blob().sha256(), Material("b")->blob().sha256());
}

TEST_F(WorkerPoolTest, AnUpdateOfWhatWasReplacedMeanwhileFails) {
  StartPool(1);
  const TileSetId id{"plane-16", "wool"};
  const auto first = catalog_.blobs->Put("first");
  ASSERT_TRUE(catalog_
                  .Write<v1::TileSet>(
                      [&](Database& db) { return PutTileSet(db, id, *first, {}, OnTaken::kRefuse, 1); })
                  .ok());
  const auto update = [&](const std::string& params) {
    const auto record = catalog_.Write<JobRecord>([&](Database& db) {
      return InsertJob(db, {"update", 1, params, {*first}, TileSetName(id), OnTaken::kReplace, ""},
                       catalog_.now_ms);
    });
    EXPECT_TRUE(record.ok()) << record.status();
    pool_->Wake();
    return WaitForEnd(record->id);
  };
  const auto held = [&] {
    return *catalog_.blobs->ReadAll(
        catalog_.Write<v1::TileSet>([&](Database& db) { return GetTileSet(db, id); })->blob().sha256(), 100);
  };
  EXPECT_EQ(update("once").state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(held(), "blob of once");
  const v1::Job late = update("twice");
  EXPECT_EQ(late.state(), v1::Job::FAILED);
  EXPECT_EQ(late.error().message(), "arrangements/plane-16/tileSets/wool was replaced meanwhile");
  EXPECT_EQ(held(), "blob of once");
}

TEST_F(WorkerPoolTest, ANewTileSetGetsAThumbnailWhichAnUpdateKeeps) {
  StartPool(1);
  const TileSetId id{"plane-16", "wool"};
  const auto queued = [&](const std::string& params, const std::string& kind,
                          std::vector<std::string> inputs) {
    const auto record = catalog_.Write<JobRecord>([&](Database& db) {
      return InsertJob(db, {kind, 1, params, std::move(inputs), TileSetName(id), OnTaken::kReplace, ""},
                       catalog_.now_ms);
    });
    EXPECT_TRUE(record.ok()) << record.status();
    pool_->Wake();
    return record->id;
  };
  const auto get = [&] {
    return *catalog_.Write<v1::TileSet>([&](Database& db) { return GetTileSet(db, id); });
  };
  const auto picture = [&] { return *catalog_.blobs->ReadAll(get().thumbnail().sha256(), 100); };
  // The thumbnail's job is in the catalog once the tile set is.
  const int64_t made = queued("tiles wool", "test", {});
  EXPECT_EQ(WaitForEnd(made).state(), v1::Job::SUCCEEDED);
  const v1::Job drawn = WaitForEnd(made + 1);
  EXPECT_EQ(drawn.state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(drawn.kind(), "thumbnail");
  EXPECT_EQ(drawn.result_name(), "arrangements/plane-16/tileSets/wool/thumbnail");
  EXPECT_EQ(picture(), "picture of blob of tiles wool");

  EXPECT_EQ(WaitForEnd(queued("certified", "update", {get().blob().sha256()})).state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(*catalog_.blobs->ReadAll(get().blob().sha256(), 100), "blob of certified");
  EXPECT_EQ(picture(), "picture of blob of tiles wool");

  const int64_t remade = queued("tiles silk", "test", {});
  EXPECT_EQ(WaitForEnd(remade).state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(WaitForEnd(remade + 1).state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(picture(), "picture of blob of tiles silk");
}

TEST_F(WorkerPoolTest, AThumbnailThatFailsLeavesItsTileSet) {
  StartPool(1);
  const TileSetId id{"plane-16", "wool"};
  const int64_t made = Insert(TileSetName(id), "ugly");
  EXPECT_EQ(WaitForEnd(made).state(), v1::Job::SUCCEEDED);
  EXPECT_EQ(WaitForEnd(made + 1).state(), v1::Job::FAILED);
  const auto get = [&] {
    return catalog_.Write<v1::TileSet>([&](Database& db) { return GetTileSet(db, id); });
  };
  ASSERT_TRUE(get().ok());
  EXPECT_FALSE(get()->has_thumbnail());
}

TEST_F(WorkerPoolTest, ANameTakenMeanwhileFailsTheJob) {
  StartPool(1);
  const int64_t running = Insert("materials/x", "sleep");
  WaitForRun(running);
  const int64_t id = Insert("materials/wool", "good");
  const auto blob = catalog_.blobs->Put("other");
  ASSERT_TRUE(catalog_
                  .Write<v1::Material>(
                      [&](Database& db) { return PutMaterial(db, "wool", *blob, {}, OnTaken::kRefuse, 1); })
                  .ok());
  ASSERT_TRUE(pool_->Cancel(running).ok());
  EXPECT_EQ(WaitForEnd(id).error().detail().reason(), "NAME_TAKEN");
  EXPECT_EQ(Material("wool")->blob().sha256(), *blob);
}

TEST(JobEventsTest, NothingElseBearsTheNumberOfTheLastEvent) {
  JobEvents events;
  JobRecord record;
  record.id = 1;
  record.sequence = 2;
  record.job.set_state(v1::Job::RUNNING);
  events.BeginRun(record);
  events.Report(1, {"stage", 1, 10, "rows"});
  const uint64_t last = events.NextSequence(1);
  // The end is being written: whoever asks now still sees a running job, and must be told of the end
  // afterwards.
  EXPECT_LT(events.EventOf(record).sequence(), last);
  events.Report(1, {"other stage", 1, 10, "rows"});
  EXPECT_LT(events.EventOf(record).sequence(), last);
  EXPECT_EQ(events.NextSequence(1), last);
}

TEST_F(WorkerPoolTest, EventsGrowAndEndWithTheJob) {
  std::mutex mutex;
  std::condition_variable ended;
  std::vector<v1::JobEvent> seen;
  const int64_t id = Insert("materials/wool", "sleep");
  const uint64_t watch = events_.Watch(id, [&](const absl::StatusOr<v1::JobEvent>& event) {
    const std::lock_guard lock(mutex);
    ASSERT_TRUE(event.ok()) << event.status();
    seen.push_back(*event);
    ended.notify_all();
  });
  StartPool(1);
  WaitFor(id, [](const v1::Job& job) { return job.progress().done() > 0; });
  ASSERT_TRUE(pool_->Cancel(id).ok());
  {
    std::unique_lock lock(mutex);
    ASSERT_TRUE(
        ended.wait_for(lock, kPatience, [&] { return !seen.empty() && IsFinal(seen.back().job().state()); }));
    ASSERT_GE(seen.size(), 3u);
    for (size_t i = 1; i < seen.size(); ++i) {
      EXPECT_GT(seen[i].sequence(), seen[i - 1].sequence());
    }
  }
  events_.Unwatch(watch);
  EXPECT_EQ(events_.num_watchers(), 0u);
}

}  // namespace
}  // namespace tessera
