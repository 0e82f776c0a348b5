// What the window shows and what was asked for, without GL: events of the loader come in, requests to it go
// out.
//
//   ViewerState state(loader, {.choice = {.mesh = "builtin:torus", .arrangement = "surface-96"}});
//   state.Begin();
//   for (LoadEvent& event : loader.Take()) state.Apply(std::move(event));
//   state.Select("surface-96/wool");      // a click
//   draw state.surface() in state.shown()
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "btf/image/tone_map.h"
#include "btf/light/frequency_light.h"
#include "viewer/loader.h"
#include "viewer/orbit_camera.h"
#include "viewer/recent.h"

namespace tessera::viewer {

// Light from all around, in the frequency domain; none without `light`.
struct Sky {
  std::shared_ptr<const FrequencyLight> light;
  double azimuth_rad = 0.0;  // turned by, about the vertical, counter-clockwise seen from above
  double strength = 1.0;
  bool operator==(const Sky&) const = default;
};

struct ViewerOptions {
  std::string server;
  SurfaceChoice choice;
  std::string tile_set;                       // to begin with; empty: the first of the list
  std::shared_ptr<const FrequencyLight> sky;  // or none; the other light is then out to begin with
};

// Something that went wrong, or that is worth knowing, until it is put away.
struct Notice {
  bool is_error = true;
  std::string text;
  std::string subject;  // one message a subject: a newer one replaces it
};

// Tile sets that stay resident: at most this many, of at most this size together.
inline constexpr size_t kMostResident = 16;
inline constexpr uint64_t kMostResidentBytes = uint64_t{1} << 30;

// Of the main thread.
class ViewerState {
 public:
  // `loader` must outlive it.
  ViewerState(Loader& loader, ViewerOptions options);

  // Asks for the surface; its arrival asks for the list.
  void Begin();
  void Apply(LoadEvent event);
  // Asks for the list again, and for the surface when there is none.
  void Refresh();
  // Shows this tile set: at once when it is resident, else when the loader brings it; what is shown stays
  // until then. Clicks that follow replace it.
  void Select(const std::string& name);
  // The listed tile set is in view and its thumbnail is not here: asks for it, once until the list is asked
  // for again. Nothing where the server has none.
  void WantThumbnail(const TileSetEntry& entry);
  // Of the picture, pixels: what the surface is framed in when it comes.
  void SetSceneSize(int width, int height);
  // Frames the surface again.
  void ResetCamera();
  void DismissMessage(std::string_view subject);
  // Replaces the message of this subject; an empty text removes it.
  void Tell(Notice message);

  [[nodiscard]] const ViewerOptions& options() const { return options_; }
  [[nodiscard]] const std::string& arrangement() const { return arrangement_; }
  [[nodiscard]] const std::shared_ptr<const Dressing>& dressing() const { return dressing_; }
  [[nodiscard]] const std::vector<TileSetEntry>& entries() const { return entries_; }
  [[nodiscard]] const std::vector<Notice>& messages() const { return messages_; }
  // The tile set asked for last; shown, or still on its way.
  [[nodiscard]] const std::string& selected() const { return selected_; }
  [[nodiscard]] const std::string& shown_name() const { return shown_name_; }
  [[nodiscard]] const std::shared_ptr<const TileSet>& shown() const { return shown_; }
  [[nodiscard]] bool is_loading() const { return is_loading_; }
  // The entry of a listed tile set, or nullptr.
  [[nodiscard]] const TileSetEntry* EntryOf(std::string_view name) const;
  [[nodiscard]] bool IsResident(const TileSetEntry& entry) const { return resident_.Contains(entry.sha256); }
  [[nodiscard]] uint64_t resident_bytes() const { return resident_.cost(); }
  [[nodiscard]] size_t num_resident() const { return resident_.size(); }
  // How long the last tile set took from the server or the disk; 0 when it was resident.
  [[nodiscard]] double load_ms() const { return load_ms_; }

  // Thumbnails that came, with their digests; emptied by the call.
  [[nodiscard]] std::vector<std::pair<std::string, Pixels>> TakeThumbnails();

  OrbitCamera camera;
  LightAngles light;
  Sky sky;
  Tone tone;

 private:
  void ApplySurface(LoadEvent event);
  void ApplyList(LoadEvent event);
  void ApplyTileSet(LoadEvent event);
  void ApplyThumbnail(LoadEvent event);
  void ShowSet(const std::string& name, std::shared_ptr<const TileSet> tile_set);

  Loader& loader_;
  const ViewerOptions options_;
  std::string arrangement_;
  std::shared_ptr<const Dressing> dressing_;
  std::vector<TileSetEntry> entries_;
  std::vector<Notice> messages_;
  std::string selected_;
  std::string shown_name_;
  std::shared_ptr<const TileSet> shown_;
  bool is_loading_ = false;
  int scene_width_ = 640;
  int scene_height_ = 480;
  double load_ms_ = 0.0;
  Recent<std::string, std::shared_ptr<const TileSet>> resident_{kMostResident, kMostResidentBytes};
  std::set<std::string> thumbnails_wanted_;  // by digest
  std::vector<std::pair<std::string, Pixels>> thumbnails_;
};

// Bytes that a tile set holds in memory, about.
[[nodiscard]] uint64_t SizeInMemory(const TileSet& tile_set);

}  // namespace tessera::viewer
