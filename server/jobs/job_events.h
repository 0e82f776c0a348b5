// Who is told how far a job is. Progress lives here only; states come from the catalog.
//
// Events of one job carry growing sequence numbers, over restarts of the server too. A watcher may miss
// intermediate ones but never the last.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "server/catalog/job_table.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Thread-safe.
class JobEvents {
 public:
  // Called from any thread, by two at once too, so that events may come out of order; perhaps once more after
  // Unwatch. Must be quick. An error means that nothing more will be told of this run.
  using Watcher = std::function<void(const absl::StatusOr<v1::JobEvent>&)>;

  // A run begins with this record, RUNNING.
  void BeginRun(const JobRecord& record);
  // Tells progress, at most every 100 ms unless the stage changes or ends. Ignored for jobs that do not run.
  void Report(int64_t id, const Progress& progress);
  // The number for the event that ends the run: larger than all that were told, and from now on progress is
  // not, so that nobody takes another event for this one.
  [[nodiscard]] uint64_t NextSequence(int64_t id);
  // The run has ended with this record, as the catalog has it.
  void EndRun(const JobRecord& record);
  // The run has ended and nobody can tell how: watchers get `error`.
  void LoseRun(int64_t id, const absl::Status& error);
  // Any other change.
  void Publish(const JobRecord& record);

  // The job with its progress, and the number of its last event.
  [[nodiscard]] v1::JobEvent EventOf(const JobRecord& record) const;

  // Calls `watcher` with every later event of the job.
  [[nodiscard]] uint64_t Watch(int64_t id, Watcher watcher);
  void Unwatch(uint64_t watch);
  [[nodiscard]] size_t num_watchers() const;

 private:
  struct Run {
    v1::Job job;
    uint64_t sequence = 0;
    std::chrono::steady_clock::time_point told;
    bool ending = false;
  };
  struct Watched {
    int64_t id = 0;
    std::shared_ptr<const Watcher> watcher;
  };
  void Tell(int64_t id, const v1::Job& job, uint64_t sequence) const;
  void Tell(int64_t id, const absl::StatusOr<v1::JobEvent>& event) const;

  mutable std::mutex mutex_;  // guards what follows
  std::map<int64_t, Run> runs_;
  std::map<uint64_t, Watched> watchers_;
  uint64_t next_watch_ = 1;
};

}  // namespace tessera
