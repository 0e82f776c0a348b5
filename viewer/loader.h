// All waiting of the viewer, on a thread of its own: reading and dressing meshes, the server's list, tile
// sets.
//
//   Loader loader(MakeServerSource(address), [] { glfwPostEmptyEvent(); });
//   loader.Open(choice);
//   loader.List("surface-96");
//   loader.Show("surface-96/wool");        // then, every frame:
//   for (LoadEvent& event : loader.Take()) state.Apply(event);
//
// One piece of work runs at a time, in the order surface, list, tile set to show, thumbnails. A newer request
// of a kind replaces an older one, also one that runs: that is stopped, and says nothing. Thumbnails queue up
// and give way: one that runs when something else is asked for is stopped and begun again later.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/status.h>

#include "viewer/source.h"

namespace tessera::viewer {

// What became of one request.
struct LoadEvent {
  enum class Kind { kSurface, kList, kTileSet, kThumbnail };
  Kind kind = Kind::kSurface;
  std::string name;  // of the tile set, or the arrangement listed
  absl::Status status;
  Surface surface;
  std::vector<TileSetEntry> entries;
  std::shared_ptr<const TileSet> tile_set;
  Pixels thumbnail;
  std::string thumbnail_sha256;
  double load_ms = 0.0;
};

// Thread-safe.
class Loader {
 public:
  // `wake` is called, from the loader's thread, whenever there is something to take.
  Loader(std::unique_ptr<Source> source, std::function<void()> wake);
  // Stops what runs and waits for it.
  ~Loader();
  Loader(const Loader&) = delete;
  Loader& operator=(const Loader&) = delete;

  void Open(SurfaceChoice choice);
  void List(std::string arrangement);
  void Show(std::string name);
  // Nothing when it is queued already.
  void LoadThumbnail(TileSetEntry entry);
  // Drops the tile set to show, queued or running.
  void CancelShow();

  // What has ended since the last call, oldest first.
  [[nodiscard]] std::vector<LoadEvent> Take();
  // What runs, for people: "surface-96/wool: download, 3 of 10 MiB". Empty when nothing does.
  [[nodiscard]] std::string Activity() const;
  // Nothing runs, waits or is to be taken.
  [[nodiscard]] bool IsIdle() const;

 private:
  struct Request {
    LoadEvent::Kind kind = LoadEvent::Kind::kSurface;
    std::string name;
    SurfaceChoice choice;
    TileSetEntry entry;  // of kThumbnail
  };

  void Ask(std::optional<Request>& slot, Request request);
  void StopRunningLocked(LoadEvent::Kind kind);
  std::optional<Request> NextLocked();
  void Run(std::stop_token stop);
  LoadEvent Perform(const Request& request, const RunContext& context);
  void Finish(const Request& request, LoadEvent event);

  const std::unique_ptr<Source> source_;  // of the thread
  const std::function<void()> wake_;
  mutable std::mutex mutex_;  // guards what follows, up to events_
  std::condition_variable_any changed_;
  std::optional<Request> surface_;
  std::optional<Request> list_;
  std::optional<Request> show_;
  std::deque<TileSetEntry> thumbnails_;
  std::optional<Request> running_;
  std::stop_source running_stop_;
  std::string activity_;
  std::vector<LoadEvent> events_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace tessera::viewer
