// A source that answers when the test lets it, and that can be stopped.
#pragma once

#include <chrono>
#include <condition_variable>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "btf/base/status_macros.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dress.h"
#include "btf/wang/shapes.h"
#include "viewer/loader.h"
#include "viewer/source.h"

namespace tessera::viewer {

// Consistent with the arrangement, of one BTFel.
inline std::shared_ptr<const TileSet> FlatTileSet(const std::string& arrangement_id) {
  const Arrangement& arrangement = **FindArrangement(arrangement_id);
  TileSet tile_set;
  tile_set.arrangement_id = arrangement.id;
  tile_set.arrangement_sha256 = arrangement.sha256;
  tile_set.tile_size = 16;
  tile_set.strip_height = 8;
  tile_set.tile_codes = arrangement.codes;
  tile_set.tile_index.resize(arrangement.codes.size() * 16 * 16);
  tile_set.btfels.codes.resize(1);
  tile_set.btfels.num_coefficients = 1;
  return std::make_shared<const TileSet>(std::move(tile_set));
}

// What the source and the test share; the loader owns the source.
class FakeServer {
 public:
  // Fetching this name waits until Release or a stop.
  void Hold(const std::string& name) {
    const std::lock_guard lock(mutex_);
    held_[name] = true;
  }
  void Release(const std::string& name) {
    {
      const std::lock_guard lock(mutex_);
      held_[name] = false;
    }
    changed_.notify_all();
  }
  void WaitUntilFetching(const std::string& name) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return !fetched_.empty() && fetched_.back() == name; });
  }
  // In the order of their beginnings.
  std::vector<std::string> fetched() {
    const std::lock_guard lock(mutex_);
    return fetched_;
  }

  absl::StatusOr<std::shared_ptr<const TileSet>> Fetch(const std::string& name, const RunContext& context) {
    std::unique_lock lock(mutex_);
    fetched_.push_back(name);
    changed_.notify_all();
    changed_.wait(lock, context.stop, [&] { return !held_[name]; });
    if (context.stop.stop_requested()) {
      return absl::CancelledError("stopped");
    }
    const auto found = sets.find(name);
    if (found == sets.end()) {
      return absl::NotFoundError("there is no " + name);
    }
    return found->second;
  }
  // Waits as Fetch does.
  absl::StatusOr<Pixels> FetchThumbnail(const TileSetEntry& entry, const RunContext& context) {
    TESSERA_RETURN_IF_ERROR(Fetch(entry.name, context).status());
    return Pixels{1, 1, {1, 2, 3, 255}};
  }

  // Before the loader begins.
  std::map<std::string, std::shared_ptr<const TileSet>> sets;
  std::set<std::string> without_thumbnail;
  absl::Status list_status;
  absl::Status surface_status;

 private:
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::map<std::string, bool> held_;
  std::vector<std::string> fetched_;
};

class FakeSource final : public Source {
 public:
  explicit FakeSource(FakeServer& server) : server_(server) {}

  absl::StatusOr<Surface> Open(const SurfaceChoice& choice, const RunContext& context) override {
    if (!server_.surface_status.ok()) {
      return server_.surface_status;
    }
    const Arrangement& arrangement = **FindArrangement(choice.arrangement);
    auto dressed = DressMesh(*BuiltinShape("plane"), arrangement, {.allow_breaks = true}, context);
    return Surface{std::make_shared<const Dressing>(std::move(dressed->dressing)), ""};
  }
  absl::StatusOr<std::vector<TileSetEntry>> List(const std::string& arrangement, const RunContext&) override {
    if (!server_.list_status.ok()) {
      return server_.list_status;
    }
    std::vector<TileSetEntry> entries;
    for (const auto& [name, tile_set] : server_.sets) {
      if (name.starts_with(arrangement + "/")) {
        const bool has_thumbnail = !server_.without_thumbnail.contains(name);
        entries.push_back({.name = name,
                           .sha256 = "digest of " + name,
                           .thumbnail_sha256 = has_thumbnail ? "picture of " + name : ""});
      }
    }
    return entries;
  }
  absl::StatusOr<std::shared_ptr<const TileSet>> Fetch(const std::string& name,
                                                       const RunContext& context) override {
    return server_.Fetch(name, context);
  }
  absl::StatusOr<Pixels> FetchThumbnail(const TileSetEntry& entry, const RunContext& context) override {
    return server_.FetchThumbnail(entry, context);
  }

 private:
  FakeServer& server_;
};

// All events until the loader has nothing to do.
inline std::vector<LoadEvent> TakeAll(Loader& loader) {
  std::vector<LoadEvent> events;
  while (!loader.IsIdle()) {
    for (LoadEvent& event : loader.Take()) {
      events.push_back(std::move(event));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return events;
}

}  // namespace tessera::viewer
