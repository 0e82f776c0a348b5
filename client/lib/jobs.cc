// The job calls of Client.
#include <grpcpp/client_context.h>

#include <absl/strings/cord.h>
#include <absl/strings/str_cat.h>
#include <absl/types/optional.h>

#include "btf/base/status_macros.h"
#include "client/lib/client.h"
#include "client/lib/names.h"
#include "client/lib/stubs.h"

namespace tessera {
namespace {

constexpr absl::string_view kJobPayload = "tessera.job";

bool IsFinal(v1::Job::State state) {
  return state == v1::Job::SUCCEEDED || state == v1::Job::FAILED || state == v1::Job::CANCELLED;
}

}  // namespace

absl::StatusOr<v1::Job> Client::GetJob(std::string_view name, const RunContext& context) {
  v1::GetJobRequest request;
  request.set_name(std::string(name));
  return CallUnary(*stubs_->jobs, &v1::Jobs::Stub::GetJob, request, options_.retry, context);
}

absl::StatusOr<std::vector<v1::Job>> Client::ListJobs(const RunContext& context) {
  std::vector<v1::Job> all;
  v1::ListJobsRequest request;
  do {
    TESSERA_ASSIGN_OR_RETURN(
        v1::ListJobsResponse response,
        CallUnary(*stubs_->jobs, &v1::Jobs::Stub::ListJobs, request, options_.retry, context));
    all.insert(all.end(), response.jobs().begin(), response.jobs().end());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  return all;
}

absl::StatusOr<v1::Job> Client::CancelJob(std::string_view name, const RunContext& context) {
  v1::CancelJobRequest request;
  request.set_name(std::string(name));
  return CallUnary(*stubs_->jobs, &v1::Jobs::Stub::CancelJob, request, options_.retry, context);
}

absl::StatusOr<v1::Job> Client::WatchJob(std::string_view name, uint64_t after_sequence,
                                         const std::function<void(const v1::JobEvent&)>& on_event,
                                         const RunContext& context) {
  v1::WatchJobRequest request;
  request.set_name(std::string(name));
  request.set_after_sequence(after_sequence);
  Backoff backoff(options_.retry, context);
  while (true) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    StoppableCall call(context);
    const std::unique_ptr<grpc::ClientReader<v1::JobEvent>> stream =
        stubs_->jobs->WatchJob(call.rpc(), request);
    v1::JobEvent event;
    v1::Job last;
    while (stream->Read(&event)) {
      // A server that crashed may number from its last durable event; never show one twice.
      if (event.sequence() <= request.after_sequence()) {
        continue;
      }
      request.set_after_sequence(event.sequence());
      backoff.Reset();
      last = event.job();
      if (on_event) {
        on_event(event);
      }
    }
    const absl::Status status = StatusFromGrpc(stream->Finish());
    if (IsFinal(last.state())) {
      return last;
    }
    if (status.ok()) {
      // The stream ended before the final event: either it was seen already (after_sequence was that of the
      // final event) or the server is stopping.
      TESSERA_ASSIGN_OR_RETURN(v1::Job job, GetJob(name, context));
      if (IsFinal(job.state())) {
        return job;
      }
      TESSERA_RETURN_IF_ERROR(backoff.Wait(
          absl::UnavailableError(absl::StrCat("the server ended the watch of ", ShortName(name)))));
      continue;
    }
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (!absl::IsUnavailable(status)) {
      return status;
    }
    TESSERA_RETURN_IF_ERROR(backoff.Wait(status));
  }
}

absl::StatusOr<v1::Job> Client::WaitForJob(std::string_view name, OnStop on_stop, const RunContext& context) {
  const absl::StatusOr<v1::Job> job = WatchJob(
      name, 0,
      [&context](const v1::JobEvent& event) {
        const v1::JobProgress& progress = event.job().progress();
        if (event.job().state() == v1::Job::QUEUED) {
          context.Report("queued", 0, 0, "");
        } else if (!progress.stage().empty()) {
          context.Report(progress.stage(), progress.done(), progress.total(), progress.unit());
        }
      },
      context);
  if (!job.ok()) {
    if (context.stop.stop_requested() && on_stop == OnStop::kCancelJob) {
      v1::CancelJobRequest request;
      request.set_name(std::string(name));
      request.set_withdrawn_request_id(TakeRequestId(name));
      // The caller's stop must not stop this call, too.
      TESSERA_RETURN_IF_ERROR(
          CallUnary(*stubs_->jobs, &v1::Jobs::Stub::CancelJob, request, options_.retry, RunContext())
              .status());
    }
    return job.status();
  }
  TakeRequestId(name);
  TESSERA_RETURN_IF_ERROR(JobFailure(*job));
  return *job;
}

absl::StatusOr<v1::Job> Client::Asked(absl::StatusOr<v1::Job> job, const std::string& request_id) {
  if (job.ok()) {
    const std::lock_guard lock(asked_mutex_);
    asked_.emplace(job->name(), request_id);
  }
  return job;
}

std::string Client::TakeRequestId(std::string_view job_name) {
  const std::lock_guard lock(asked_mutex_);
  const auto it = asked_.find(job_name);
  return it == asked_.end() ? std::string() : asked_.extract(it).mapped();
}

absl::Status JobFailure(const v1::Job& job) {
  if (job.state() != v1::Job::FAILED && job.state() != v1::Job::CANCELLED) {
    return absl::OkStatus();
  }
  const bool failed = job.state() == v1::Job::FAILED;
  absl::StatusCode code =
      failed ? static_cast<absl::StatusCode>(job.error().code()) : absl::StatusCode::kCancelled;
  if (code == absl::StatusCode::kOk) {
    code = absl::StatusCode::kUnknown;  // a record that contradicts itself must not read as success
  }
  absl::Status status(code, failed ? absl::StrCat(job.name(), ": ", job.error().message())
                                   : absl::StrCat(job.name(), " was cancelled"));
  if (failed && !job.error().detail().reason().empty()) {
    status = WithReason(std::move(status), job.error().detail().reason(), job.error().detail().subject());
  }
  status.SetPayload(kJobPayload, absl::Cord(job.name()));
  return status;
}

std::string FailedJob(const absl::Status& status) {
  const absl::optional<absl::Cord> payload = status.GetPayload(kJobPayload);
  return payload.has_value() ? std::string(*payload) : std::string();
}

}  // namespace tessera
