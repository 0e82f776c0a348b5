#include "server/rpc/jobs.h"

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "proto/wire/names.h"
#include "proto/wire/status.h"

namespace tessera {
namespace {

constexpr int64_t kDefaultWaitMs = 60'000;
constexpr int64_t kMaxWaitMs = 600'000;

absl::StatusOr<v1::JobEvent> CurrentEvent(const Backend& backend, int64_t id) {
  v1::JobEvent event;
  TESSERA_RETURN_IF_ERROR(backend.connections.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(const JobRecord record, FindJob(db, id));
    event = backend.events.EventOf(record);
    return absl::OkStatus();
  }));
  return event;
}

}  // namespace

absl::StatusOr<std::shared_ptr<JobWatch>> JobWatch::Begin(const Backend& backend, int64_t id,
                                                          uint64_t after_sequence,
                                                          std::function<void()> ready) {
  if (backend.events.num_watchers() >= kMaxWatchers) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the server has ", kMaxWatchers, " watchers of jobs, its limit; try again later"));
  }
  std::shared_ptr<JobWatch> watch(new JobWatch(backend, after_sequence));
  // First the watch, then the state: no event between the two is lost.
  watch->watch_ = backend.events.Watch(id, [weak = std::weak_ptr<JobWatch>(watch), ready = std::move(ready)](
                                               const absl::StatusOr<v1::JobEvent>& event) {
    if (const auto alive = weak.lock()) {
      alive->OnEvent(event);
      ready();
    }
  });
  TESSERA_ASSIGN_OR_RETURN(const v1::JobEvent current, CurrentEvent(backend, id));
  if (after_sequence > current.sequence()) {
    // A number this server never told (another data folder): start anew rather than stay silent.
    const std::lock_guard lock(watch->mutex_);
    watch->told_sequence_ = 0;
  }
  watch->OnEvent(current);
  return watch;
}

JobWatch::~JobWatch() {
  backend_.events.Unwatch(watch_);
}

void JobWatch::OnEvent(const absl::StatusOr<v1::JobEvent>& event) {
  const std::lock_guard lock(mutex_);
  if (!event.ok()) {
    error_ = event.status();
  } else if (event->sequence() > latest_.sequence()) {
    latest_ = *event;
  }
}

JobWatch::News JobWatch::Next() {
  const std::lock_guard lock(mutex_);
  News news;
  news.has_event = latest_.sequence() > told_sequence_;
  if (news.has_event) {
    news.event = latest_;
    told_sequence_ = latest_.sequence();
  }
  news.ended = IsFinal(latest_.job().state());
  if (!news.ended && !error_.ok()) {
    news.ended = true;
    news.error = error_;
  }
  return news;
}

absl::StatusOr<v1::JobEvent> JobWatch::Latest() {
  const std::lock_guard lock(mutex_);
  if (!error_.ok() && !IsFinal(latest_.job().state())) {
    return error_;
  }
  return latest_;
}

absl::StatusOr<v1::Job> JobsService::GetJob(const v1::GetJobRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const int64_t id, ParseJobName(request.name()));
  TESSERA_ASSIGN_OR_RETURN(const v1::JobEvent event, CurrentEvent(backend_, id));
  return event.job();
}

absl::StatusOr<v1::ListJobsResponse> JobsService::ListJobs(const v1::ListJobsRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const Page page, ParsePage(kJobList, request.page_size(), request.page_token()));
  v1::ListJobsResponse response;
  TESSERA_RETURN_IF_ERROR(backend_.connections.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(response, tessera::ListJobs(db, page));
    return absl::OkStatus();
  }));
  return response;
}

absl::StatusOr<v1::Job> JobsService::CancelJob(const v1::CancelJobRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const int64_t id, ParseJobName(request.name()));
  TESSERA_ASSIGN_OR_RETURN(const JobRecord record, backend_.pool.Cancel(id, request.withdrawn_request_id()));
  return backend_.events.EventOf(record).job();
}

absl::StatusOr<std::shared_ptr<JobWatch>> JobsService::WatchJob(const v1::WatchJobRequest& request,
                                                                std::function<void()> ready) const {
  TESSERA_ASSIGN_OR_RETURN(const int64_t id, ParseJobName(request.name()));
  return JobWatch::Begin(backend_, id, request.after_sequence(), std::move(ready));
}

absl::StatusOr<int64_t> JobsService::WaitTimeoutMs(const v1::WaitJobRequest& request) {
  if (request.timeout_ms() > kMaxWaitMs) {
    return WithReason(absl::InvalidArgumentError(
                          absl::StrCat("timeout_ms ", request.timeout_ms(), ", at most ", kMaxWaitMs)),
                      "ARGUMENT_INVALID", "timeout_ms");
  }
  return request.timeout_ms() == 0 ? kDefaultWaitMs : int64_t{request.timeout_ms()};
}

}  // namespace tessera
