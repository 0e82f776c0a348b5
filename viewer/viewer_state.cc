#include "viewer/viewer_state.h"

#include <algorithm>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/wang/redress.h"

namespace tessera::viewer {
namespace {

constexpr char kSurfaceSubject[] = "mesh";
constexpr char kListSubject[] = "list";
constexpr char kTileSetSubject[] = "tile set";

std::string TextOf(std::string_view what, const absl::Status& status) {
  return absl::StrCat(std::string(what), ": ", std::string(status.message()));
}

}  // namespace

uint64_t SizeInMemory(const TileSet& tile_set) {
  return tile_set.btfels.codes.size() + 4 * (tile_set.tile_index.size() + tile_set.source_pixels.size()) +
         tile_set.seam_heat.size();
}

ViewerState::ViewerState(Loader& loader, ViewerOptions options)
    : sky{.light = options.sky}, loader_(loader), options_(std::move(options)), selected_(options_.tile_set) {
  if (sky.light != nullptr) {
    light.strength = 0.0;
  }
}

void ViewerState::Begin() {
  loader_.Open(options_.choice);
}

void ViewerState::Apply(LoadEvent event) {
  switch (event.kind) {
    case LoadEvent::Kind::kSurface:
      return ApplySurface(std::move(event));
    case LoadEvent::Kind::kList:
      return ApplyList(std::move(event));
    case LoadEvent::Kind::kTileSet:
      return ApplyTileSet(std::move(event));
    case LoadEvent::Kind::kThumbnail:
      return ApplyThumbnail(std::move(event));
  }
}

void ViewerState::ApplySurface(LoadEvent event) {
  if (!event.status.ok()) {
    Tell({true, TextOf("no mesh", event.status), kSurfaceSubject});
    return;
  }
  Tell({false, event.surface.note, kSurfaceSubject});
  dressing_ = std::move(event.surface.dressing);
  arrangement_ = dressing_->arrangement_id;
  ResetCamera();
  loader_.List(arrangement_);
  if (!selected_.empty()) {
    Select(std::string(selected_));
  }
}

void ViewerState::ApplyList(LoadEvent event) {
  if (!event.status.ok()) {
    std::string text = TextOf("no list of tile sets", event.status);
    if (absl::IsUnavailable(event.status)) {
      absl::StrAppend(&text, "; start one with: tessera-server --data DIR --listen ", options_.server,
                      ", then Refresh");
    }
    Tell({true, std::move(text), kListSubject});
    return;
  }
  entries_ = std::move(event.entries);
  Tell({false,
        entries_.empty() ? absl::StrCat("The server at ", options_.server, " has no tile sets of ",
                                        arrangement_, " yet: tessera tileset synthesize makes them.")
                         : std::string(),
        kListSubject});
  if (selected_.empty() && !entries_.empty()) {
    Select(entries_.front().name);
  }
}

void ViewerState::ApplyTileSet(LoadEvent event) {
  if (event.name != selected_) {
    return;
  }
  is_loading_ = false;
  if (!event.status.ok()) {
    Tell({true, TextOf(event.name, event.status), kTileSetSubject});
    return;
  }
  if (const TileSetEntry* const entry = EntryOf(event.name)) {
    resident_.Put(entry->sha256, event.tile_set, SizeInMemory(*event.tile_set));
  }
  load_ms_ = event.load_ms;
  ShowSet(event.name, std::move(event.tile_set));
}

void ViewerState::ApplyThumbnail(LoadEvent event) {
  if (!event.status.ok()) {
    return;  // the list shows the name all the same; a click tells what is wrong
  }
  thumbnails_.emplace_back(std::move(event.thumbnail_sha256), std::move(event.thumbnail));
}

void ViewerState::ShowSet(const std::string& name, std::shared_ptr<const TileSet> tile_set) {
  if (dressing_ != nullptr) {
    if (const auto binding = Redress(*dressing_, *tile_set); !binding.ok()) {
      Tell({true, TextOf(name, binding.status()), kTileSetSubject});
      return;
    }
  }
  DismissMessage(kTileSetSubject);
  shown_name_ = name;
  shown_ = std::move(tile_set);
}

void ViewerState::Refresh() {
  if (dressing_ == nullptr) {
    Begin();
    return;
  }
  thumbnails_wanted_.clear();  // what could not be fetched may be there now
  loader_.List(arrangement_);
  if (shown_ == nullptr && !selected_.empty()) {
    Select(std::string(selected_));
  }
}

void ViewerState::Select(const std::string& name) {
  selected_ = name;
  const TileSetEntry* const entry = EntryOf(name);
  if (entry != nullptr) {
    if (const std::shared_ptr<const TileSet>* const resident = resident_.Use(entry->sha256)) {
      loader_.CancelShow();
      is_loading_ = false;
      load_ms_ = 0.0;
      ShowSet(name, *resident);
      return;
    }
  }
  is_loading_ = true;
  loader_.Show(name);
}

void ViewerState::WantThumbnail(const TileSetEntry& entry) {
  if (!entry.thumbnail_sha256.empty() && thumbnails_wanted_.insert(entry.thumbnail_sha256).second) {
    loader_.LoadThumbnail(entry);
  }
}

void ViewerState::SetSceneSize(int width, int height) {
  scene_width_ = width;
  scene_height_ = height;
}

void ViewerState::ResetCamera() {
  if (dressing_ != nullptr) {
    camera = OrbitCamera(FramingCamera(dressing_->mesh, scene_width_, scene_height_));
  }
}

void ViewerState::DismissMessage(std::string_view subject) {
  std::erase_if(messages_, [&](const Notice& message) { return message.subject == subject; });
}

void ViewerState::Tell(Notice message) {
  const auto old = std::find_if(messages_.begin(), messages_.end(),
                                [&](const Notice& m) { return m.subject == message.subject; });
  if (message.text.empty()) {
    DismissMessage(message.subject);
  } else if (old != messages_.end()) {
    *old = std::move(message);
  } else {
    messages_.push_back(std::move(message));
  }
}

const TileSetEntry* ViewerState::EntryOf(std::string_view name) const {
  const auto found =
      std::find_if(entries_.begin(), entries_.end(), [&](const TileSetEntry& e) { return e.name == name; });
  return found == entries_.end() ? nullptr : &*found;
}

std::vector<std::pair<std::string, Pixels>> ViewerState::TakeThumbnails() {
  return std::exchange(thumbnails_, {});
}

}  // namespace tessera::viewer
