#include "server/jobs/job_events.h"

#include <utility>
#include <vector>

#include "proto/wire/convert.h"

namespace tessera {
namespace {

constexpr std::chrono::milliseconds kTellInterval{100};

}  // namespace

void JobEvents::Tell(int64_t id, const v1::Job& job, uint64_t sequence) const {
  v1::JobEvent event;
  event.set_sequence(sequence);
  *event.mutable_job() = job;
  Tell(id, event);
}

void JobEvents::Tell(int64_t id, const absl::StatusOr<v1::JobEvent>& event) const {
  std::vector<std::shared_ptr<const Watcher>> watchers;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [watch, watched] : watchers_) {
      if (watched.id == id) {
        watchers.push_back(watched.watcher);
      }
    }
  }
  for (const auto& watcher : watchers) {
    (*watcher)(event);
  }
}

void JobEvents::BeginRun(const JobRecord& record) {
  {
    const std::lock_guard lock(mutex_);
    runs_[record.id] = Run{.job = record.job, .sequence = record.sequence};
  }
  Tell(record.id, record.job, record.sequence);
}

void JobEvents::Report(int64_t id, const Progress& progress) {
  const auto now = std::chrono::steady_clock::now();
  v1::Job job;
  uint64_t sequence = 0;
  {
    const std::lock_guard lock(mutex_);
    const auto it = runs_.find(id);
    if (it == runs_.end() || it->second.ending) {
      return;
    }
    Run& run = it->second;
    v1::JobProgress& told = *run.job.mutable_progress();
    const bool new_stage = told.stage() != progress.stage;
    const bool stage_ends = progress.total != 0 && progress.done >= progress.total;
    if (!new_stage && !stage_ends && now - run.told < kTellInterval) {
      return;
    }
    run.told = now;
    told = MessageFromProgress(progress);
    sequence = ++run.sequence;
    job = run.job;
  }
  Tell(id, job, sequence);
}

uint64_t JobEvents::NextSequence(int64_t id) {
  const std::lock_guard lock(mutex_);
  const auto it = runs_.find(id);
  if (it == runs_.end()) {
    return 0;
  }
  it->second.ending = true;
  return it->second.sequence + 1;
}

void JobEvents::EndRun(const JobRecord& record) {
  v1::Job job = record.job;
  {
    const std::lock_guard lock(mutex_);
    if (const auto it = runs_.find(record.id); it != runs_.end()) {
      *job.mutable_progress() = it->second.job.progress();
      runs_.erase(it);
    }
  }
  Tell(record.id, job, record.sequence);
}

void JobEvents::LoseRun(int64_t id, const absl::Status& error) {
  {
    const std::lock_guard lock(mutex_);
    runs_.erase(id);
  }
  Tell(id, error);
}

void JobEvents::Publish(const JobRecord& record) {
  Tell(record.id, record.job, record.sequence);
}

v1::JobEvent JobEvents::EventOf(const JobRecord& record) const {
  v1::JobEvent event;
  event.set_sequence(record.sequence);
  *event.mutable_job() = record.job;
  const std::lock_guard lock(mutex_);
  const auto it = runs_.find(record.id);
  if (it != runs_.end() && record.job.state() == v1::Job::RUNNING &&
      it->second.job.attempt() == record.job.attempt()) {
    event.set_sequence(it->second.sequence);
    *event.mutable_job()->mutable_progress() = it->second.job.progress();
  }
  return event;
}

uint64_t JobEvents::Watch(int64_t id, Watcher watcher) {
  const std::lock_guard lock(mutex_);
  const uint64_t watch = next_watch_++;
  watchers_[watch] = {id, std::make_shared<const Watcher>(std::move(watcher))};
  return watch;
}

void JobEvents::Unwatch(uint64_t watch) {
  const std::lock_guard lock(mutex_);
  watchers_.erase(watch);
}

size_t JobEvents::num_watchers() const {
  const std::lock_guard lock(mutex_);
  return watchers_.size();
}

}  // namespace tessera
