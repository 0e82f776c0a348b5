// The service tessera.v1.Jobs, apart from the waiting itself: a watch hands events to a callback and holds no
// thread.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/rpc/backend.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Watches and waits at once, over all jobs: each costs a few kilobytes. More are refused with
// RESOURCE_EXHAUSTED.
inline constexpr size_t kMaxWatchers = 1000;

// Events of one job in order, only the newest kept until it is taken; ends with the job. Thread-safe.
class JobWatch {
 public:
  // `ready` is called, from any thread, whenever Next may have news.
  [[nodiscard]] static absl::StatusOr<std::shared_ptr<JobWatch>> Begin(const Backend& backend, int64_t id,
                                                                       uint64_t after_sequence,
                                                                       std::function<void()> ready);
  ~JobWatch();

  struct News {
    bool has_event = false;
    v1::JobEvent event;
    bool ended = false;  // after `event`, nothing will come
    absl::Status error;  // why nothing will come though the job has not ended
  };
  [[nodiscard]] News Next();
  // The newest event, taken or not; an error when nothing more will come though the job has not ended.
  [[nodiscard]] absl::StatusOr<v1::JobEvent> Latest();

 private:
  JobWatch(const Backend& backend, uint64_t after_sequence)
      : backend_(backend), told_sequence_(after_sequence) {}
  void OnEvent(const absl::StatusOr<v1::JobEvent>& event);

  const Backend& backend_;
  uint64_t watch_ = 0;
  std::mutex mutex_;  // guards what follows
  v1::JobEvent latest_;
  absl::Status error_;
  uint64_t told_sequence_ = 0;
};

// Each function is the RPC of its name. Thread-safe.
class JobsService {
 public:
  explicit JobsService(const Backend& backend) : backend_(backend) {}

  [[nodiscard]] absl::StatusOr<v1::Job> GetJob(const v1::GetJobRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::ListJobsResponse> ListJobs(const v1::ListJobsRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::Job> CancelJob(const v1::CancelJobRequest& request) const;
  [[nodiscard]] absl::StatusOr<std::shared_ptr<JobWatch>> WatchJob(const v1::WatchJobRequest& request,
                                                                   std::function<void()> ready) const;
  // How long WaitJob waits. Errors: INVALID_ARGUMENT above 10 minutes.
  [[nodiscard]] static absl::StatusOr<int64_t> WaitTimeoutMs(const v1::WaitJobRequest& request);

 private:
  const Backend& backend_;
};

}  // namespace tessera
