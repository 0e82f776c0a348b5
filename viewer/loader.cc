#include "viewer/loader.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"

namespace tessera::viewer {
namespace {

std::string ActivityText(const std::string& subject, const Progress& progress) {
  std::string text = absl::StrCat(subject, ": ", std::string(progress.stage));
  if (progress.total > 0) {
    absl::StrAppend(&text, ", ", 100 * progress.done / progress.total, " %");
  }
  return text;
}

std::string SubjectOf(LoadEvent::Kind kind, const std::string& name) {
  switch (kind) {
    case LoadEvent::Kind::kSurface:
      return "mesh";
    case LoadEvent::Kind::kList:
      return absl::StrCat("tile sets of ", name);
    case LoadEvent::Kind::kTileSet:
      return name;
    case LoadEvent::Kind::kThumbnail:
      return absl::StrCat("thumbnail of ", name);
  }
  return name;
}

}  // namespace

Loader::Loader(std::unique_ptr<Source> source, std::function<void()> wake)
    : source_(std::move(source)),
      wake_(std::move(wake)),
      thread_([this](std::stop_token stop) { Run(std::move(stop)); }) {}

Loader::~Loader() {
  {
    const std::lock_guard lock(mutex_);
    surface_.reset();
    list_.reset();
    show_.reset();
    thumbnails_.clear();
    running_stop_.request_stop();
  }
  thread_.request_stop();
  thread_.join();
}

void Loader::Open(SurfaceChoice choice) {
  Ask(surface_, {.kind = LoadEvent::Kind::kSurface, .choice = std::move(choice)});
}

void Loader::List(std::string arrangement) {
  Ask(list_, {.kind = LoadEvent::Kind::kList, .name = std::move(arrangement)});
}

void Loader::Show(std::string name) {
  Ask(show_, {.kind = LoadEvent::Kind::kTileSet, .name = std::move(name)});
}

void Loader::Ask(std::optional<Request>& slot, Request request) {
  {
    const std::lock_guard lock(mutex_);
    StopRunningLocked(request.kind);
    StopRunningLocked(LoadEvent::Kind::kThumbnail);
    slot = std::move(request);
  }
  changed_.notify_one();
}

void Loader::StopRunningLocked(LoadEvent::Kind kind) {
  if (running_.has_value() && running_->kind == kind) {
    running_stop_.request_stop();
  }
}

void Loader::LoadThumbnail(TileSetEntry entry) {
  {
    const std::lock_guard lock(mutex_);
    const auto is_same = [&](const TileSetEntry& other) {
      return other.thumbnail_sha256 == entry.thumbnail_sha256;
    };
    const bool runs =
        running_.has_value() && running_->kind == LoadEvent::Kind::kThumbnail && is_same(running_->entry);
    if (runs || std::any_of(thumbnails_.begin(), thumbnails_.end(), is_same)) {
      return;
    }
    thumbnails_.push_back(std::move(entry));
  }
  changed_.notify_one();
}

void Loader::CancelShow() {
  const std::lock_guard lock(mutex_);
  show_.reset();
  StopRunningLocked(LoadEvent::Kind::kTileSet);
}

std::vector<LoadEvent> Loader::Take() {
  const std::lock_guard lock(mutex_);
  return std::exchange(events_, {});
}

std::string Loader::Activity() const {
  const std::lock_guard lock(mutex_);
  return activity_;
}

bool Loader::IsIdle() const {
  const std::lock_guard lock(mutex_);
  return !running_ && !surface_ && !list_ && !show_ && thumbnails_.empty() && events_.empty();
}

std::optional<Loader::Request> Loader::NextLocked() {
  for (std::optional<Request>* const slot : {&surface_, &list_, &show_}) {
    if (slot->has_value()) {
      return std::exchange(*slot, std::nullopt);
    }
  }
  if (thumbnails_.empty()) {
    return std::nullopt;
  }
  Request request{.kind = LoadEvent::Kind::kThumbnail,
                  .name = thumbnails_.front().name,
                  .entry = std::move(thumbnails_.front())};
  thumbnails_.pop_front();
  return request;
}

void Loader::Run(std::stop_token stop) {
  while (true) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, stop, [this] { return surface_ || list_ || show_ || !thumbnails_.empty(); });
    if (stop.stop_requested()) {
      return;
    }
    const std::optional<Request> request = NextLocked();
    running_ = request;
    running_stop_ = std::stop_source();
    const std::string subject = SubjectOf(request->kind, request->name);
    activity_ = subject;
    const RunContext context{.stop = running_stop_.get_token(), .progress = [&](const Progress& progress) {
                               const std::lock_guard activity_lock(mutex_);
                               activity_ = ActivityText(subject, progress);
                             }};
    lock.unlock();
    Finish(*request, Perform(*request, context));
  }
}

LoadEvent Loader::Perform(const Request& request, const RunContext& context) {
  const auto begin = std::chrono::steady_clock::now();
  LoadEvent event{.kind = request.kind, .name = request.name};
  const auto take = [&event](auto result, auto& value) {
    event.status = result.status();
    if (result.ok()) {
      value = *std::move(result);
    }
  };
  switch (request.kind) {
    case LoadEvent::Kind::kSurface:
      take(source_->Open(request.choice, context), event.surface);
      break;
    case LoadEvent::Kind::kList:
      take(source_->List(request.name, context), event.entries);
      break;
    case LoadEvent::Kind::kTileSet:
      take(source_->Fetch(request.name, context), event.tile_set);
      break;
    case LoadEvent::Kind::kThumbnail:
      event.thumbnail_sha256 = request.entry.thumbnail_sha256;
      take(source_->FetchThumbnail(request.entry, context), event.thumbnail);
      break;
  }
  event.load_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  return event;
}

void Loader::Finish(const Request& request, LoadEvent event) {
  {
    const std::lock_guard lock(mutex_);
    running_.reset();
    activity_.clear();
    if (!running_stop_.stop_requested()) {
      events_.push_back(std::move(event));
    } else if (request.kind == LoadEvent::Kind::kThumbnail) {
      thumbnails_.push_front(request.entry);
    }
  }
  if (wake_) {
    wake_();
  }
}

}  // namespace tessera::viewer
