// The durable queue: every SQL statement about jobs. All functions run inside the caller's transaction.
//
// QUEUED -> RUNNING by one statement, ClaimJob, which also counts the attempt and sets a lease token. Every
// later write of the worker names that token and fails once the job was taken from it. RUNNING -> SUCCEEDED,
// FAILED, CANCELLED, or back to QUEUED: handed back by a stopping server (the attempt does not count) or
// after its worker died (it does).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/catalog/page.h"
#include "server/catalog/resources.h"
#include "server/catalog/sqlite.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Runs that may die before a job is given up.
inline constexpr int kMaxAttempts = 3;

struct NewJob {
  std::string kind;
  int version = 1;  // of the kind: a changed algorithm gets a new one
  std::string params;
  std::vector<std::string> inputs;  // SHA-256 of blobs
  std::string result_name;          // full name of what it makes
  OnTaken on_taken = OnTaken::kRefuse;
  std::string request_id;  // of the call that asks for it, may be empty
};

struct JobRecord {
  int64_t id = 0;
  v1::Job job;  // progress is not stored
  uint64_t sequence = 0;
  int version = 1;
  std::string params;
  std::vector<std::string> inputs;  // only while the job has not ended
  std::string dedupe_sha256;
  OnTaken on_taken = OnTaken::kRefuse;
  bool cancel_requested = false;
  std::string lease_token;  // only while RUNNING
};

[[nodiscard]] bool IsFinal(v1::Job::State state);

// Queues a job, or returns the one that is already doing the same work for the same name. Errors:
// ALREADY_EXISTS (NAME_TAKEN) when the name is taken, or about to be by another job, and not to be replaced;
// NOT_FOUND (BLOB_MISSING) naming an input.
[[nodiscard]] absl::StatusOr<JobRecord> InsertJob(Database& db, const NewJob& job, int64_t now_ms);

// Errors: NOT_FOUND.
[[nodiscard]] absl::StatusOr<JobRecord> FindJob(Database& db, int64_t id);
inline constexpr std::string_view kJobList = "jobs";
// Newest first.
[[nodiscard]] absl::StatusOr<v1::ListJobsResponse> ListJobs(Database& db, const Page& page);

[[nodiscard]] absl::StatusOr<bool> AnyQueuedJob(Database& db);
// The oldest queued job whose work no running job does, now RUNNING; none when there is none.
[[nodiscard]] absl::StatusOr<std::optional<JobRecord>> ClaimJob(Database& db, const std::string& lease_token,
                                                                int64_t lease_until_ms, int64_t now_ms);

// What equal work has made before and the store still has.
struct FinishedWork {
  std::string blob_sha256;
  std::string message;
};
[[nodiscard]] absl::StatusOr<std::optional<FinishedWork>> FindFinishedWork(Database& db,
                                                                           const std::string& dedupe_sha256);

// Writes of the worker that holds `lease_token`. `sequence` numbers the event that the change is told by.
// Errors: ABORTED when the job is not held by this token any more.
[[nodiscard]] absl::Status ExtendLease(Database& db, int64_t id, const std::string& lease_token,
                                       int64_t lease_until_ms);
[[nodiscard]] absl::Status FinishJob(Database& db, int64_t id, const std::string& lease_token,
                                     uint64_t sequence, const FinishedWork& work, int64_t now_ms);
[[nodiscard]] absl::Status FailJob(Database& db, int64_t id, const std::string& lease_token,
                                   uint64_t sequence, const absl::Status& error, int64_t now_ms);
[[nodiscard]] absl::Status EndCancelledJob(Database& db, int64_t id, const std::string& lease_token,
                                           uint64_t sequence, int64_t now_ms);
// QUEUED again, or CANCELLED when that was asked for meanwhile.
[[nodiscard]] absl::Status PutBackJob(Database& db, int64_t id, const std::string& lease_token,
                                      uint64_t sequence, int64_t now_ms);

// Ends a queued job, marks a running one, leaves one that has ended. With a request_id, takes back that call
// only and leaves a job that other calls still ask for. Errors: NOT_FOUND.
[[nodiscard]] absl::StatusOr<JobRecord> RequestCancel(Database& db, int64_t id,
                                                      const std::string& withdrawn_request_id,
                                                      int64_t now_ms);

// Takes RUNNING jobs whose lease ended before `lease_before_ms` from their dead workers: CANCELLED when that
// was asked for, FAILED (CRASHED) after kMaxAttempts, else QUEUED. Returns their ids. The largest time means
// all.
[[nodiscard]] absl::StatusOr<std::vector<int64_t>> RecoverJobs(Database& db, int64_t lease_before_ms,
                                                               int64_t now_ms);

}  // namespace tessera
