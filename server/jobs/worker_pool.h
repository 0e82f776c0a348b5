// Threads that claim jobs, run them and commit what they made.
//
// A job's blob, the name that points to it and the job's end are one transaction: all are there or none. A
// stopping pool asks running jobs to stop and hands them back to the queue; a killed one leaves them RUNNING,
// and the next start queues them again (RecoverJobs).
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <spdlog/logger.h>

#include "server/catalog/blob_store.h"
#include "server/catalog/clock.h"
#include "server/catalog/connections.h"
#include "server/catalog/job_table.h"
#include "server/jobs/job.h"
#include "server/jobs/job_events.h"

namespace tessera {

// Thread-safe.
class WorkerPool {
 public:
  WorkerPool(Connections& connections, BlobStore& blobs, JobEvents& events, std::vector<JobKind> kinds,
             Clock clock, std::shared_ptr<spdlog::logger> logger);
  ~WorkerPool();

  // The version of a registered kind. Errors: UNIMPLEMENTED naming the kind.
  [[nodiscard]] absl::StatusOr<int> KindVersion(const std::string& kind) const;

  // Takes over jobs of a server that died and starts `num_workers` threads, at least 1. Each job may use
  // every core: TBB shares them between the jobs that run.
  [[nodiscard]] absl::Status Start(int num_workers);
  // Hands running jobs back and joins the threads. Idempotent.
  void Stop();

  // A queued job may be there.
  void Wake();
  // Inside the caller's transaction, which puts the tile set: queues the job that draws its thumbnail, unless
  // it has one or no such kind is registered. Wake() afterwards.
  [[nodiscard]] absl::Status QueueThumbnail(Database& db, const v1::TileSet& tile_set) const;
  // Ends a queued job at once. A running one is asked to stop; if it has not after 800 ms it is CANCELLED all
  // the same and whatever it still makes is thrown away. With a request_id, only takes back that call: the
  // job goes on while others want it. Errors: NOT_FOUND.
  [[nodiscard]] absl::StatusOr<JobRecord> Cancel(int64_t id, const std::string& withdrawn_request_id = "");

 private:
  using SteadyTime = std::chrono::steady_clock::time_point;
  struct Running {
    std::stop_source stop;
    std::string lease_token;
    bool cancel_requested = false;
    SteadyTime end_by = SteadyTime::max();  // of a cancelled run
  };

  void WorkerLoop();
  void MaintenanceLoop(const std::stop_token& stop);
  // OK when every running job is held for another kLeaseMs, or known to be lost.
  [[nodiscard]] absl::Status ExtendLeases();
  [[nodiscard]] absl::Status TakeLostJobs(int64_t lease_before_ms);
  void EndOverdueCancels();
  void CollectGarbage();
  [[nodiscard]] absl::StatusOr<std::optional<JobRecord>> Claim();
  void Run(const JobRecord& record);
  [[nodiscard]] absl::Status Execute(const JobRecord& record, const std::stop_token& stop);
  [[nodiscard]] const JobKind* FindKind(const JobRecord& record) const;
  [[nodiscard]] absl::Status TakeOverEqualWork(const JobRecord& record, bool& taken);
  [[nodiscard]] absl::Status Commit(const JobRecord& record, const JobOutput& output);
  [[nodiscard]] absl::Status CommitRows(Database& db, const JobRecord& record, const FinishedWork& work);
  void SettleFailure(const JobRecord& record, const absl::Status& status);
  void TellEnd(int64_t id);
  [[nodiscard]] bool stopping();

  Connections& connections_;
  BlobStore& blobs_;
  JobEvents& events_;
  const std::vector<JobKind> kinds_;
  const Clock clock_;
  const std::shared_ptr<spdlog::logger> logger_;

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  bool stopping_ = false;
  uint64_t wakes_ = 0;  // so that a wake between a vain claim and the wait is not lost
  uint64_t next_lease_ = 0;
  std::map<int64_t, Running> running_;

  std::vector<std::jthread> workers_;
  std::jthread maintenance_;
};

}  // namespace tessera
