#include "server/jobs/worker_pool.h"

#include <algorithm>
#include <exception>
#include <functional>
#include <new>
#include <span>

#include <fcntl.h>
#include <unistd.h>

#include <absl/strings/str_cat.h>

#include "proto/wire/names.h"
#include "proto/wire/status.h"
#include "server/catalog/files.h"
#include "server/catalog/resources.h"

namespace tessera {
namespace {

constexpr int64_t kLeaseMs = 60'000;
constexpr std::chrono::milliseconds kTick{100};
constexpr std::chrono::seconds kHeartbeatInterval{5};
constexpr std::chrono::hours kGarbageInterval{1};
constexpr std::chrono::milliseconds kCancelGrace{800};
// How long a worker tries to record a failure while the catalog cannot be written.
constexpr int kRecordTries = 10;
constexpr std::chrono::seconds kRecordRetryWait{1};
constexpr size_t kCopyBlockBytes = 1 << 20;

class StoreReader : public BlobReader {
 public:
  explicit StoreReader(BlobStore& store) : store_(store) {}

  absl::StatusOr<std::string> ReadAll(std::string_view sha256, uint64_t limit_bytes) const override {
    return store_.ReadAll(sha256, limit_bytes);
  }

  absl::Status CopyTo(std::string_view sha256, const std::filesystem::path& path) const override {
    TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<const BlobHandle> blob, store_.Get(sha256));
    TESSERA_ASSIGN_OR_RETURN(File file, File::Open(path, O_WRONLY | O_CREAT | O_EXCL));
    std::string block(std::min<uint64_t>(kCopyBlockBytes, blob->size_bytes()), '\0');
    for (uint64_t offset = 0; offset < blob->size_bytes(); offset += block.size()) {
      const auto bytes = std::as_writable_bytes(std::span(block))
                             .first(std::min<uint64_t>(block.size(), blob->size_bytes() - offset));
      TESSERA_RETURN_IF_ERROR(blob->ReadAt(offset, bytes));
      TESSERA_RETURN_IF_ERROR(file.WriteAt(offset, bytes));
    }
    return absl::OkStatus();
  }

 private:
  BlobStore& store_;
};

// Libraries below a job, and allocation in our own part of it, may throw: no exception may end the server.
absl::Status Guarded(const std::function<absl::Status()>& work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("the job needs more memory than the server has");
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("the job failed: ", error.what()));
  }
}

}  // namespace

WorkerPool::WorkerPool(Connections& connections, BlobStore& blobs, JobEvents& events,
                       std::vector<JobKind> kinds, Clock clock, std::shared_ptr<spdlog::logger> logger)
    : connections_(connections),
      blobs_(blobs),
      events_(events),
      kinds_(std::move(kinds)),
      clock_(std::move(clock)),
      logger_(std::move(logger)) {}

WorkerPool::~WorkerPool() {
  Stop();
}

absl::StatusOr<int> WorkerPool::KindVersion(const std::string& kind) const {
  for (const JobKind& known : kinds_) {
    if (known.name == kind) {
      return known.version;
    }
  }
  return absl::UnimplementedError(absl::StrCat("this server runs no jobs of kind \"", kind, "\""));
}

absl::Status WorkerPool::Start(int num_workers) {
  // The data folder has one server at a time, so whatever runs belongs to a dead one.
  TESSERA_RETURN_IF_ERROR(TakeLostJobs(INT64_MAX));
  for (int i = 0; i < std::max(1, num_workers); ++i) {
    workers_.emplace_back([this] { WorkerLoop(); });
  }
  maintenance_ = std::jthread([this](const std::stop_token& stop) { MaintenanceLoop(stop); });
  return absl::OkStatus();
}

void WorkerPool::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    for (auto& [id, running] : running_) {
      running.stop.request_stop();
    }
  }
  changed_.notify_all();
  workers_.clear();  // joins
  maintenance_ = {};
}

bool WorkerPool::stopping() {
  const std::lock_guard lock(mutex_);
  return stopping_;
}

void WorkerPool::Wake() {
  {
    const std::lock_guard lock(mutex_);
    ++wakes_;
  }
  changed_.notify_all();
}

absl::StatusOr<JobRecord> WorkerPool::Cancel(int64_t id, const std::string& withdrawn_request_id) {
  JobRecord record;
  TESSERA_RETURN_IF_ERROR(connections_.Write([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(record, RequestCancel(db, id, withdrawn_request_id, clock_()));
    return absl::OkStatus();
  }));
  if (!record.cancel_requested) {
    return record;
  }
  if (record.job.state() == v1::Job::CANCELLED) {
    events_.Publish(record);
  }
  const std::lock_guard lock(mutex_);
  if (const auto it = running_.find(id); it != running_.end() && !it->second.cancel_requested) {
    it->second.cancel_requested = true;
    it->second.end_by = std::chrono::steady_clock::now() + kCancelGrace;
    it->second.stop.request_stop();
  }
  return record;
}

absl::Status WorkerPool::QueueThumbnail(Database& db, const v1::TileSet& tile_set) const {
  const absl::StatusOr<int> version = KindVersion(std::string(kThumbnailKind));
  if (!version.ok() || tile_set.has_thumbnail()) {
    return absl::OkStatus();
  }
  TESSERA_ASSIGN_OR_RETURN(const TileSetId id, ParseTileSetName(tile_set.name()));
  const NewJob job{std::string(kThumbnailKind), *version,          "",
                   {tile_set.blob().sha256()},  ThumbnailName(id), OnTaken::kReplace};
  return InsertJob(db, job, clock_()).status();
}

void WorkerPool::WorkerLoop() {
  while (true) {
    uint64_t wakes = 0;
    {
      const std::lock_guard lock(mutex_);
      if (stopping_) {
        return;
      }
      wakes = wakes_;
    }
    std::optional<JobRecord> claimed;
    const absl::Status status = Guarded([&]() -> absl::Status {
      TESSERA_ASSIGN_OR_RETURN(claimed, Claim());
      return absl::OkStatus();
    });
    if (claimed) {
      Run(*claimed);
      continue;
    }
    if (!status.ok()) {
      logger_->error("cannot claim a job: {}", status.ToString());
    }
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::seconds(1), [&] { return stopping_ || wakes_ != wakes; });
  }
}

absl::StatusOr<std::optional<JobRecord>> WorkerPool::Claim() {
  std::string lease_token;
  {
    const std::lock_guard lock(mutex_);
    lease_token = absl::StrCat(getpid(), "-", clock_(), "-", next_lease_++);
  }
  std::optional<JobRecord> record;
  bool any = false;
  TESSERA_RETURN_IF_ERROR(connections_.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(any, AnyQueuedJob(db));
    return absl::OkStatus();
  }));
  if (!any) {
    return record;
  }
  TESSERA_RETURN_IF_ERROR(connections_.Write([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(record, ClaimJob(db, lease_token, clock_() + kLeaseMs, clock_()));
    return absl::OkStatus();
  }));
  return record;
}

void WorkerPool::Run(const JobRecord& record) {
  std::stop_token stop;
  {
    const std::lock_guard lock(mutex_);
    Running& running = running_[record.id];
    running.lease_token = record.lease_token;
    stop = running.stop.get_token();
    if (stopping_) {
      running.stop.request_stop();
    }
  }
  // A cancel between the claim and the line above found no run to stop.
  bool cancelled = false;
  connections_
      .Read([&](Database& db) -> absl::Status {
        TESSERA_ASSIGN_OR_RETURN(const JobRecord now, FindJob(db, record.id));
        cancelled = now.cancel_requested;
        return absl::OkStatus();
      })
      .IgnoreError();
  if (cancelled) {
    const std::lock_guard lock(mutex_);
    running_[record.id].cancel_requested = true;
    running_[record.id].stop.request_stop();
  }
  events_.BeginRun(record);
  logger_->info("{} ({}, for {}) begins, attempt {}", record.job.name(), record.job.kind(),
                record.job.result_name(), record.job.attempt());
  const absl::Status status = Guarded([&] { return Execute(record, stop); });
  if (status.ok()) {
    logger_->info("{} succeeded", record.job.name());
    TellEnd(record.id);
  } else {
    SettleFailure(record, status);
  }
  {
    const std::lock_guard lock(mutex_);
    running_.erase(record.id);
  }
  Wake();  // equal work may have waited for this run
}

absl::Status WorkerPool::Execute(const JobRecord& record, const std::stop_token& stop) {
  bool taken = false;
  TESSERA_RETURN_IF_ERROR(TakeOverEqualWork(record, taken));
  if (taken) {
    return absl::OkStatus();
  }
  const JobKind* const kind = FindKind(record);
  if (kind == nullptr || kind->version != record.version) {
    return absl::UnimplementedError(absl::StrCat("this server does not run jobs of kind \"",
                                                 record.job.kind(), "\", version ", record.version));
  }
  const StoreReader reader(blobs_);
  TESSERA_ASSIGN_OR_RETURN(const auto scratch, blobs_.MakeScratch());
  JobContext context;
  context.run.stop = stop;
  context.run.progress = [this, id = record.id](const Progress& progress) { events_.Report(id, progress); };
  context.blobs = &reader;
  context.scratch_folder = scratch->folder();
  TESSERA_RETURN_IF_ERROR(context.run.CheckStop());
  TESSERA_ASSIGN_OR_RETURN(const JobOutput output, kind->run({record.params, record.inputs}, context));
  return Commit(record, output);
}

const JobKind* WorkerPool::FindKind(const JobRecord& record) const {
  const auto kind = std::find_if(kinds_.begin(), kinds_.end(),
                                 [&](const JobKind& known) { return known.name == record.job.kind(); });
  return kind == kinds_.end() ? nullptr : &*kind;
}

absl::Status WorkerPool::TakeOverEqualWork(const JobRecord& record, bool& taken) {
  return connections_.Write([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(const std::optional<FinishedWork> work,
                             FindFinishedWork(db, record.dedupe_sha256));
    if (!work) {
      return absl::OkStatus();
    }
    taken = true;
    return CommitRows(db, record, *work);
  });
}

absl::Status WorkerPool::Commit(const JobRecord& record, const JobOutput& output) {
  TESSERA_ASSIGN_OR_RETURN(const StagedBlob staged, blobs_.Stage(output.blob));
  const FinishedWork work{
      staged.sha256(),
      std::visit([](const auto& message) { return message.SerializeAsString(); }, output.resource)};
  return connections_.Write([&](Database& db) -> absl::Status {
    TESSERA_RETURN_IF_ERROR(staged.InsertRow(db, clock_()));
    return CommitRows(db, record, work);
  });
}

absl::Status WorkerPool::CommitRows(Database& db, const JobRecord& record, const FinishedWork& work) {
  const std::string& name = record.job.result_name();
  if (const auto drawn = ParseThumbnailName(name); drawn.ok()) {
    TESSERA_RETURN_IF_ERROR(PutThumbnail(db, *drawn, record.inputs.back(), work.blob_sha256, clock_()));
  } else if (const auto material = ParseMaterialName(name); material.ok()) {
    v1::Material message;
    if (!message.ParseFromString(work.message)) {
      return absl::InternalError("the job described its result as something else than a material");
    }
    TESSERA_RETURN_IF_ERROR(
        PutMaterial(db, *material, work.blob_sha256, std::move(message), record.on_taken, clock_()).status());
  } else {
    TESSERA_ASSIGN_OR_RETURN(const TileSetId id, ParseTileSetName(name));
    v1::TileSet message;
    if (!message.ParseFromString(work.message)) {
      return absl::InternalError("the job described its result as something else than a tile set");
    }
    if (const JobKind* const kind = FindKind(record); kind != nullptr && kind->updates_result) {
      TESSERA_ASSIGN_OR_RETURN(const v1::TileSet now, GetTileSet(db, id));
      if (now.blob().sha256() != record.inputs.back()) {
        return absl::FailedPreconditionError(absl::StrCat(name, " was replaced meanwhile"));
      }
      if (now.has_thumbnail()) {
        *message.mutable_thumbnail() = now.thumbnail();
      }
    }
    TESSERA_ASSIGN_OR_RETURN(const v1::TileSet put, PutTileSet(db, id, work.blob_sha256, std::move(message),
                                                               record.on_taken, clock_()));
    TESSERA_RETURN_IF_ERROR(QueueThumbnail(db, put));
  }
  return FinishJob(db, record.id, record.lease_token, events_.NextSequence(record.id), work, clock_());
}

void WorkerPool::SettleFailure(const JobRecord& record, const absl::Status& status) {
  bool cancel_requested = false;
  bool hand_back = false;
  {
    const std::lock_guard lock(mutex_);
    cancel_requested = running_[record.id].cancel_requested;
    hand_back = stopping_ && !cancel_requested;
  }
  const bool stopped = status.code() == absl::StatusCode::kCancelled;
  const auto settle = [&](Database& db) -> absl::Status {
    const uint64_t sequence = events_.NextSequence(record.id);
    if (stopped && hand_back) {
      return PutBackJob(db, record.id, record.lease_token, sequence, clock_());
    }
    if (stopped && cancel_requested) {
      return EndCancelledJob(db, record.id, record.lease_token, sequence, clock_());
    }
    return FailJob(db, record.id, record.lease_token, sequence, status, clock_());
  };
  absl::Status settled = connections_.Write(settle);
  for (int tries = 1; tries < kRecordTries && !settled.ok() && settled.code() != absl::StatusCode::kAborted;
       ++tries) {
    logger_->error("cannot record the end of {}: {}", record.job.name(), settled.ToString());
    if (stopping()) {
      break;  // the next start finds it RUNNING and queues it again
    }
    std::this_thread::sleep_for(kRecordRetryWait);
    settled = connections_.Write(settle);
  }
  if (settled.ok()) {
    logger_->info("{} {}: {}", record.job.name(), stopped && hand_back ? "is handed back" : "ended",
                  status.ToString());
  }
  TellEnd(record.id);
}

void WorkerPool::TellEnd(int64_t id) {
  const absl::Status status = connections_.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(const JobRecord record, FindJob(db, id));
    events_.EndRun(record);
    return absl::OkStatus();
  });
  if (!status.ok()) {
    logger_->error("cannot read {}: {}", JobName(id), status.ToString());
    events_.LoseRun(id, absl::UnavailableError(
                            absl::StrCat("the server cannot tell how ", JobName(id), " ended, ask again")));
  }
}

void WorkerPool::MaintenanceLoop(const std::stop_token& stop) {
  auto heartbeat = std::chrono::steady_clock::now();
  auto garbage = heartbeat - kGarbageInterval;
  while (!stop.stop_requested()) {
    EndOverdueCancels();
    const auto now = std::chrono::steady_clock::now();
    if (now - heartbeat >= kHeartbeatInterval) {
      heartbeat = now;
      // A job whose end could not be recorded is held by nobody: it runs again once its lease is over.
      absl::Status status = ExtendLeases();
      if (status.ok()) {
        status = TakeLostJobs(clock_());
      }
      if (!status.ok()) {
        logger_->error("cannot look after the leases: {}", status.ToString());
      }
    }
    if (now - garbage >= kGarbageInterval) {
      garbage = now;
      CollectGarbage();
    }
    std::this_thread::sleep_for(kTick);
  }
}

absl::Status WorkerPool::TakeLostJobs(int64_t lease_before_ms) {
  std::vector<JobRecord> records;
  TESSERA_RETURN_IF_ERROR(connections_.Write([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(const std::vector<int64_t> ids, RecoverJobs(db, lease_before_ms, clock_()));
    for (const int64_t id : ids) {
      TESSERA_ASSIGN_OR_RETURN(JobRecord record, FindJob(db, id));
      records.push_back(std::move(record));
    }
    return absl::OkStatus();
  }));
  for (const JobRecord& record : records) {
    logger_->warn("{} was interrupted and taken from its dead worker", record.job.name());
    events_.Publish(record);
  }
  if (!records.empty()) {
    Wake();
  }
  return absl::OkStatus();
}

absl::Status WorkerPool::ExtendLeases() {
  absl::Status failure;
  std::vector<std::pair<int64_t, std::string>> held;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [id, running] : running_) {
      held.emplace_back(id, running.lease_token);
    }
  }
  for (const auto& [id, lease_token] : held) {
    const absl::Status status = connections_.Write([&, id = id, &lease_token = lease_token](Database& db) {
      return ExtendLease(db, id, lease_token, clock_() + kLeaseMs);
    });
    if (status.code() == absl::StatusCode::kAborted) {
      const std::lock_guard lock(mutex_);
      if (const auto it = running_.find(id); it != running_.end()) {
        it->second.stop.request_stop();
      }
    } else if (!status.ok()) {
      failure = status;
    }
  }
  return failure;
}

void WorkerPool::EndOverdueCancels() {
  std::vector<std::pair<int64_t, std::string>> overdue;
  {
    const std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    for (auto& [id, running] : running_) {
      if (running.end_by <= now) {
        running.end_by = SteadyTime::max();
        overdue.emplace_back(id, running.lease_token);
      }
    }
  }
  for (const auto& [id, lease_token] : overdue) {
    const absl::Status status = connections_.Write([&, id = id, &lease_token = lease_token](Database& db) {
      return EndCancelledJob(db, id, lease_token, events_.NextSequence(id), clock_());
    });
    if (status.ok()) {
      logger_->warn("{} did not stop in time; its result will be thrown away", JobName(id));
      TellEnd(id);
    }
  }
}

void WorkerPool::CollectGarbage() {
  absl::Status status = blobs_.CollectGarbage();
  if (status.ok()) {
    status = connections_.Write([&](Database& db) { return ForgetOldAnswers(db, clock_()); });
  }
  if (!status.ok()) {
    logger_->error("cannot collect garbage: {}", status.ToString());
  }
}

}  // namespace tessera
