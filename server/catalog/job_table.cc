#include "server/catalog/job_table.h"

#include <charconv>
#include <span>

#include <google/protobuf/util/time_util.h>

#include <absl/strings/str_cat.h>

#include "btf/base/sha256.h"
#include "proto/wire/names.h"
#include "proto/wire/status.h"

namespace tessera {
namespace {

using google::protobuf::util::TimeUtil;

// Events of one run that are only told, not stored, number fewer than this; a recovered job skips them all.
constexpr uint64_t kSequenceGap = uint64_t{1} << 32;

// Each field by its length, so that no two different jobs give the same text.
std::string DedupeHash(const NewJob& job) {
  std::string text = absl::StrCat(job.kind.size(), ":", job.kind, job.version, ":", job.inputs.size(), ":");
  for (const std::string& input : job.inputs) {
    absl::StrAppend(&text, input.size(), ":", input);
  }
  text += job.params;
  return Sha256Hex(std::as_bytes(std::span(text)));
}

v1::Job::State StateFromText(const std::string& text) {
  v1::Job::State state = v1::Job::STATE_UNSPECIFIED;
  v1::Job::State_Parse(text, &state);
  return state;
}

constexpr std::string_view kColumns =
    "id, kind, version, params, dedupe_sha256, result_name, replace_existing, state, attempt, lease_token,"
    " cancel_requested, sequence, error_code, error_message, error_reason, error_subject, create_ms, "
    "start_ms, end_ms";

JobRecord RecordOfRow(const Statement& row) {
  JobRecord record;
  record.id = row.Int(0);
  record.version = static_cast<int>(row.Int(2));
  record.params = row.Text(3);
  record.dedupe_sha256 = row.Text(4);
  record.on_taken = row.Int(6) != 0 ? OnTaken::kReplace : OnTaken::kRefuse;
  record.lease_token = row.Text(9);
  record.cancel_requested = row.Int(10) != 0;
  record.sequence = static_cast<uint64_t>(row.Int(11));
  v1::Job& job = record.job;
  job.set_name(JobName(record.id));
  job.set_kind(row.Text(1));
  job.set_result_name(row.Text(5));
  job.set_state(StateFromText(row.Text(7)));
  job.set_attempt(static_cast<uint32_t>(row.Int(8)));
  if (!row.IsNull(12)) {
    job.mutable_error()->set_code(static_cast<int32_t>(row.Int(12)));
    job.mutable_error()->set_message(row.Text(13));
    job.mutable_error()->mutable_detail()->set_reason(row.Text(14));
    job.mutable_error()->mutable_detail()->set_subject(row.Text(15));
  }
  *job.mutable_create_time() = TimeUtil::MillisecondsToTimestamp(row.Int(16));
  if (!row.IsNull(17)) {
    *job.mutable_start_time() = TimeUtil::MillisecondsToTimestamp(row.Int(17));
  }
  if (!row.IsNull(18)) {
    *job.mutable_end_time() = TimeUtil::MillisecondsToTimestamp(row.Int(18));
  }
  return record;
}

absl::Status ReadInputs(Database& db, JobRecord& record) {
  TESSERA_ASSIGN_OR_RETURN(
      Statement rows, db.Query("SELECT sha256 FROM job_inputs WHERE job_id = ? ORDER BY place", record.id));
  for (;;) {
    TESSERA_ASSIGN_OR_RETURN(const bool more, rows.Step());
    if (!more) {
      return absl::OkStatus();
    }
    record.inputs.push_back(rows.Text(0));
  }
}

absl::Status LeaseLost(int64_t id) {
  return absl::AbortedError(absl::StrCat(JobName(id), " is not held by this worker any more"));
}

// After an UPDATE that names the lease token: one row, or the lease is lost.
absl::Status CheckHeld(Database& db, int64_t id, const absl::Status& status) {
  TESSERA_RETURN_IF_ERROR(status);
  return db.changes() == 1 ? absl::OkStatus() : LeaseLost(id);
}

// What only a job that has not ended needs.
absl::Status DropNeeds(Database& db, int64_t id) {
  TESSERA_RETURN_IF_ERROR(db.Run("DELETE FROM job_requesters WHERE job_id = ?", id));
  return db.Run("DELETE FROM job_inputs WHERE job_id = ?", id);
}

absl::Status AddRequester(Database& db, int64_t id, const std::string& request_id) {
  return db.Run("INSERT INTO job_requesters (job_id, request_id) VALUES (?, ?) ON CONFLICT DO NOTHING", id,
                request_id);
}

}  // namespace

bool IsFinal(v1::Job::State state) {
  return state == v1::Job::SUCCEEDED || state == v1::Job::FAILED || state == v1::Job::CANCELLED;
}

absl::StatusOr<JobRecord> InsertJob(Database& db, const NewJob& job, int64_t now_ms) {
  const std::string dedupe = DedupeHash(job);
  {
    TESSERA_ASSIGN_OR_RETURN(
        Statement rows,
        db.Query("SELECT id, dedupe_sha256 FROM jobs WHERE result_name = ? AND state IN ('QUEUED', 'RUNNING')"
                 " AND cancel_requested = 0 ORDER BY dedupe_sha256 = ? DESC, id LIMIT 1",
                 job.result_name, dedupe));
    TESSERA_ASSIGN_OR_RETURN(const bool active, rows.Step());
    if (active && rows.Text(1) == dedupe) {
      TESSERA_RETURN_IF_ERROR(AddRequester(db, rows.Int(0), job.request_id));
      return FindJob(db, rows.Int(0));
    }
    if (active && job.on_taken == OnTaken::kRefuse) {
      return WithReason(
          absl::AlreadyExistsError(absl::StrCat(job.result_name, " is being made by ", JobName(rows.Int(0)),
                                                "; set replace to take its name")),
          "NAME_TAKEN", job.result_name);
    }
  }
  if (job.on_taken == OnTaken::kRefuse) {
    TESSERA_RETURN_IF_ERROR(CheckNameFree(db, job.result_name));
  }
  for (const std::string& input : job.inputs) {
    TESSERA_ASSIGN_OR_RETURN(Statement row, db.Query("SELECT 1 FROM blobs WHERE sha256 = ?", input));
    TESSERA_ASSIGN_OR_RETURN(const bool exists, row.Step());
    if (!exists) {
      return WithReason(absl::NotFoundError(absl::StrCat("the server has no blob ", input)), "BLOB_MISSING",
                        input);
    }
  }
  TESSERA_RETURN_IF_ERROR(
      db.Run("INSERT INTO jobs (kind, version, params, dedupe_sha256, result_name, replace_existing, state, "
             "create_ms)"
             " VALUES (?, ?, ?, ?, ?, ?, 'QUEUED', ?)",
             job.kind, job.version, BlobBytes{job.params}, dedupe, job.result_name,
             job.on_taken == OnTaken::kReplace ? 1 : 0, now_ms));
  const int64_t id = db.last_insert_rowid();
  for (size_t place = 0; place < job.inputs.size(); ++place) {
    TESSERA_RETURN_IF_ERROR(db.Run("INSERT INTO job_inputs (job_id, place, sha256) VALUES (?, ?, ?)", id,
                                   place, job.inputs[place]));
  }
  TESSERA_RETURN_IF_ERROR(AddRequester(db, id, job.request_id));
  return FindJob(db, id);
}

absl::StatusOr<JobRecord> FindJob(Database& db, int64_t id) {
  TESSERA_ASSIGN_OR_RETURN(
      Statement row, db.Query(absl::StrCat("SELECT ", std::string(kColumns), " FROM jobs WHERE id = ?"), id));
  TESSERA_ASSIGN_OR_RETURN(const bool exists, row.Step());
  if (!exists) {
    return WithReason(absl::NotFoundError(absl::StrCat(JobName(id), " does not exist")), "NOT_FOUND",
                      JobName(id));
  }
  JobRecord record = RecordOfRow(row);
  TESSERA_RETURN_IF_ERROR(ReadInputs(db, record));
  return record;
}

absl::StatusOr<v1::ListJobsResponse> ListJobs(Database& db, const Page& page) {
  int64_t before = INT64_MAX;
  std::from_chars(page.after.data(), page.after.data() + page.after.size(), before);
  TESSERA_ASSIGN_OR_RETURN(Statement rows,
                           db.Query(absl::StrCat("SELECT ", std::string(kColumns),
                                                 " FROM jobs WHERE id < ? ORDER BY id DESC LIMIT ?"),
                                    before, page.size + 1));
  v1::ListJobsResponse response;
  int64_t last = 0;
  for (;;) {
    TESSERA_ASSIGN_OR_RETURN(const bool more, rows.Step());
    if (!more) {
      return response;
    }
    if (response.jobs_size() == static_cast<int>(page.size)) {
      response.set_next_page_token(PageToken(kJobList, std::to_string(last)));
      return response;
    }
    last = rows.Int(0);
    *response.add_jobs() = RecordOfRow(rows).job;
  }
}

absl::StatusOr<bool> AnyQueuedJob(Database& db) {
  TESSERA_ASSIGN_OR_RETURN(Statement row, db.Query("SELECT 1 FROM jobs WHERE state = 'QUEUED' LIMIT 1"));
  return row.Step();
}

absl::StatusOr<std::optional<JobRecord>> ClaimJob(Database& db, const std::string& lease_token,
                                                  int64_t lease_until_ms, int64_t now_ms) {
  std::optional<JobRecord> record;
  {
    TESSERA_ASSIGN_OR_RETURN(
        Statement row,
        db.Query(
            absl::StrCat("UPDATE jobs SET state = 'RUNNING', attempt = attempt + 1, sequence = sequence + 1,"
                         " lease_token = ?, lease_until_ms = ?, start_ms = ?"
                         " WHERE id = (SELECT id FROM jobs AS queued WHERE state = 'QUEUED' AND NOT EXISTS"
                         " (SELECT 1 FROM jobs AS running WHERE running.state = 'RUNNING'"
                         " AND running.dedupe_sha256 = queued.dedupe_sha256) ORDER BY id LIMIT 1) RETURNING ",
                         std::string(kColumns)),
            lease_token, lease_until_ms, now_ms));
    TESSERA_ASSIGN_OR_RETURN(bool more, row.Step());
    if (!more) {
      return std::nullopt;
    }
    record = RecordOfRow(row);
    TESSERA_ASSIGN_OR_RETURN(more, row.Step());
  }
  TESSERA_RETURN_IF_ERROR(ReadInputs(db, *record));
  return record;
}

absl::StatusOr<std::optional<FinishedWork>> FindFinishedWork(Database& db, const std::string& dedupe_sha256) {
  TESSERA_ASSIGN_OR_RETURN(
      Statement row,
      db.Query(
          "SELECT result_sha256, result_message FROM jobs JOIN blobs ON blobs.sha256 = jobs.result_sha256"
          " WHERE dedupe_sha256 = ? AND state = 'SUCCEEDED' ORDER BY id DESC LIMIT 1",
          dedupe_sha256));
  TESSERA_ASSIGN_OR_RETURN(const bool exists, row.Step());
  if (!exists) {
    return std::nullopt;
  }
  return FinishedWork{row.Text(0), row.Text(1)};
}

absl::Status ExtendLease(Database& db, int64_t id, const std::string& lease_token, int64_t lease_until_ms) {
  return CheckHeld(db, id,
                   db.Run("UPDATE jobs SET lease_until_ms = ? WHERE id = ? AND lease_token = ?",
                          lease_until_ms, id, lease_token));
}

absl::Status FinishJob(Database& db, int64_t id, const std::string& lease_token, uint64_t sequence,
                       const FinishedWork& work, int64_t now_ms) {
  TESSERA_RETURN_IF_ERROR(
      CheckHeld(db, id,
                db.Run("UPDATE jobs SET state = 'SUCCEEDED', sequence = ?, result_sha256 = ?, result_message "
                       "= ?, end_ms = ?,"
                       " lease_token = NULL, lease_until_ms = NULL WHERE id = ? AND lease_token = ?",
                       sequence, work.blob_sha256, BlobBytes{work.message}, now_ms, id, lease_token)));
  return DropNeeds(db, id);
}

absl::Status FailJob(Database& db, int64_t id, const std::string& lease_token, uint64_t sequence,
                     const absl::Status& error, int64_t now_ms) {
  TESSERA_RETURN_IF_ERROR(
      CheckHeld(db, id,
                db.Run("UPDATE jobs SET state = 'FAILED', sequence = ?, error_code = ?, error_message = ?, "
                       "error_reason = ?,"
                       " error_subject = ?, end_ms = ?, lease_token = NULL, lease_until_ms = NULL"
                       " WHERE id = ? AND lease_token = ?",
                       sequence, static_cast<int>(error.code()), std::string(error.message()),
                       ReasonOf(error), SubjectOf(error), now_ms, id, lease_token)));
  return DropNeeds(db, id);
}

absl::Status EndCancelledJob(Database& db, int64_t id, const std::string& lease_token, uint64_t sequence,
                             int64_t now_ms) {
  TESSERA_RETURN_IF_ERROR(CheckHeld(db, id,
                                    db.Run("UPDATE jobs SET state = 'CANCELLED', sequence = ?, end_ms = ?, "
                                           "lease_token = NULL, lease_until_ms = NULL"
                                           " WHERE id = ? AND lease_token = ?",
                                           sequence, now_ms, id, lease_token)));
  return DropNeeds(db, id);
}

absl::Status PutBackJob(Database& db, int64_t id, const std::string& lease_token, uint64_t sequence,
                        int64_t now_ms) {
  return CheckHeld(
      db, id,
      db.Run(
          "UPDATE jobs SET state = iif(cancel_requested, 'CANCELLED', 'QUEUED'),"
          " end_ms = iif(cancel_requested, ?, NULL), attempt = attempt - 1, sequence = ?, lease_token = NULL,"
          " lease_until_ms = NULL WHERE id = ? AND lease_token = ?",
          now_ms, sequence, id, lease_token));
}

absl::StatusOr<JobRecord> RequestCancel(Database& db, int64_t id, const std::string& withdrawn_request_id,
                                        int64_t now_ms) {
  if (!withdrawn_request_id.empty()) {
    TESSERA_RETURN_IF_ERROR(
        db.Run("DELETE FROM job_requesters WHERE job_id = ? AND request_id = ?", id, withdrawn_request_id));
    TESSERA_ASSIGN_OR_RETURN(Statement others,
                             db.Query("SELECT 1 FROM job_requesters WHERE job_id = ? LIMIT 1", id));
    TESSERA_ASSIGN_OR_RETURN(const bool wanted, others.Step());
    if (wanted) {
      return FindJob(db, id);
    }
  }
  TESSERA_RETURN_IF_ERROR(
      db.Run("UPDATE jobs SET cancel_requested = 1,"
             " sequence = iif(state = 'QUEUED', sequence + 1, sequence),"
             " end_ms = iif(state = 'QUEUED', ?, NULL), state = iif(state = 'QUEUED', 'CANCELLED', state)"
             " WHERE id = ? AND state IN ('QUEUED', 'RUNNING')",
             now_ms, id));
  TESSERA_ASSIGN_OR_RETURN(JobRecord record, FindJob(db, id));
  if (IsFinal(record.job.state())) {
    TESSERA_RETURN_IF_ERROR(DropNeeds(db, id));
  }
  return record;
}

absl::StatusOr<std::vector<int64_t>> RecoverJobs(Database& db, int64_t lease_before_ms, int64_t now_ms) {
  std::vector<int64_t> ids;
  TESSERA_ASSIGN_OR_RETURN(
      Statement rows,
      db.Query("UPDATE jobs SET sequence = sequence + ?1, lease_token = NULL, lease_until_ms = NULL,"
               " state = CASE WHEN cancel_requested THEN 'CANCELLED' WHEN attempt >= ?2 THEN 'FAILED' ELSE "
               "'QUEUED' END,"
               " end_ms = iif(cancel_requested OR attempt >= ?2, ?3, NULL),"
               " error_code = iif(NOT cancel_requested AND attempt >= ?2, ?4, NULL),"
               " error_message = iif(NOT cancel_requested AND attempt >= ?2, ?5, NULL),"
               " error_reason = iif(NOT cancel_requested AND attempt >= ?2, 'CRASHED', NULL),"
               " error_subject = iif(NOT cancel_requested AND attempt >= ?2, '', NULL)"
               " WHERE state = 'RUNNING' AND lease_until_ms < ?6 RETURNING id",
               kSequenceGap, kMaxAttempts, now_ms, static_cast<int>(absl::StatusCode::kInternal),
               absl::StrCat("the job's worker died ", kMaxAttempts, " times while running it"),
               lease_before_ms));
  for (;;) {
    TESSERA_ASSIGN_OR_RETURN(const bool more, rows.Step());
    if (!more) {
      break;
    }
    ids.push_back(rows.Int(0));
  }
  for (const char* table : {"job_inputs", "job_requesters"}) {
    TESSERA_RETURN_IF_ERROR(
        db.Run(absl::StrCat("DELETE FROM ", table,
                            " WHERE job_id IN"
                            " (SELECT id FROM jobs WHERE state IN ('SUCCEEDED', 'FAILED', 'CANCELLED'))")));
  }
  return ids;
}

}  // namespace tessera
