// Pictures of the dressed mesh, drawn on a thread of their own in a GL context of their own, so that the
// window never waits for them. The only file of the viewer that knows btf/render's previews.
//
//   SceneView view(display.scene_context(), wake);
//   view.Ask(request);                             // a newer one replaces it until it is begun
//   if (std::optional<ScenePicture> picture = view.TakePicture()) ..
//
// What a tile set needs in GL stays for the tile sets drawn recently: drawing one of those again costs a
// picture and nothing more.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include <absl/status/status.h>

#include "btf/image/tone_map.h"
#include "btf/light/frequency_light.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "viewer/mip_maker.h"
#include "viewer/pixels.h"
#include "viewer/recent.h"

namespace tessera::viewer {

struct SceneRequest {
  std::shared_ptr<const Dressing> dressing;
  std::shared_ptr<const TileSet> tile_set;
  Camera camera;
  std::vector<Light> lights;
  std::optional<FrequencyLight> sky;
  Tone tone;
  int width = 0;
  int height = 0;
};

// Of a picture: levels are drawn above kTexelsWithoutMips texels a pixel, once they are made.
enum class MipUse { kNotNeeded, kComing, kDrawn, kNone };
inline constexpr double kTexelsWithoutMips = 2.0;

struct ScenePicture {
  uint64_t number = 0;  // of the request, as Ask returned it
  absl::Status status;
  std::shared_ptr<const TileSet> tile_set;
  Pixels pixels;
  double prepare_ms = 0.0;  // of a tile set that was not resident in GL: upload, shaders; else 0
  double draw_ms = 0.0;
  double texels_per_pixel = 0.0;  // along a pixel's side
  MipUse mips = MipUse::kNotNeeded;
  std::string why_no_mips;  // of kNone
};

// What stays in GL: at most this many tile sets, of at most this size together.
inline constexpr size_t kMostPrepared = 12;
inline constexpr uint64_t kMostPreparedBytes = uint64_t{1} << 30;

// Thread-safe.
class SceneView {
 public:
  // `context` must outlive it and belongs to its thread. `wake` is called from there when there is something
  // to take.
  SceneView(OffscreenContext& context, std::function<void()> wake);
  ~SceneView();
  SceneView(const SceneView&) = delete;
  SceneView& operator=(const SceneView&) = delete;

  // Returns the request's number, from 1 on.
  uint64_t Ask(SceneRequest request);
  // A picture that mip levels were missing for comes again by itself, with the same number, once they are
  // made.
  [[nodiscard]] std::optional<ScenePicture> TakePicture();
  // Nothing waits, is drawn or is to be taken.
  [[nodiscard]] bool IsIdle() const;

 private:
  struct Prepared {
    std::shared_ptr<const Dressing> dressing;
    std::shared_ptr<const TileSet> tile_set;
    std::shared_ptr<const TileMips> mips;  // or nullptr
    std::unique_ptr<GlPreview> preview;
  };
  struct Key {
    const Dressing* dressing;
    const TileSet* tile_set;
    const TileMips* mips;
    bool operator==(const Key&) const = default;
  };

  void Run(std::stop_token stop);
  ScenePicture Draw(const SceneRequest& request, const RunContext& context);
  absl::StatusOr<GlPreview*> Prepare(const SceneRequest& request, const std::shared_ptr<const TileMips>& mips,
                                     double& prepare_ms);
  void DrawAgain();

  OffscreenContext& context_;
  const std::function<void()> wake_;
  Recent<Key, Prepared> prepared_{kMostPrepared, kMostPreparedBytes};  // of the thread
  mutable std::mutex mutex_;                                           // guards what follows, up to busy_
  std::condition_variable_any changed_;
  std::optional<SceneRequest> request_;
  std::optional<SceneRequest> last_request_;  // as it was drawn
  uint64_t num_asked_ = 0;
  std::optional<ScenePicture> picture_;
  bool busy_ = false;
  MipMaker mip_maker_;   // before thread_, which asks it
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace tessera::viewer
