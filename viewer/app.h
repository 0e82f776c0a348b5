// The viewer: state, loader, scene and panels, one frame after the other, on any display.
//
//   TESSERA_ASSIGN_OR_RETURN(auto app, App::Create(*display, MakeServerSource(server), options));
//   while (app->Frame().value_or(false)) {}
#pragma once

#include <chrono>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "viewer/display.h"
#include "viewer/gui_renderer.h"
#include "viewer/loader.h"
#include "viewer/panels/panels.h"
#include "viewer/scene_view.h"
#include "viewer/viewer_state.h"

namespace tessera::viewer {

// A tile set that was asked for and has been drawn.
struct Redressing {
  std::string tile_set;
  bool was_cached = false;  // resident here and in GL when it was asked for
  int pictures = 0;         // that were drawn from the click on, the first one of this tile set included
  double load_ms = 0.0;     // from server or disk
  double prepare_ms = 0.0;  // for GL
  double draw_ms = 0.0;     // of its first picture
  double total_ms = 0.0;    // from the click until the interface has it
};

// Of the main thread.
class App {
 public:
  // `display` must outlive it; an ImGui context must exist. Errors: those of GL.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<App>> Create(Display& display,
                                                                   std::unique_ptr<Source> source,
                                                                   ViewerOptions options);
  ~App();
  App(const App&) = delete;
  App& operator=(const App&) = delete;

  // Takes what has arrived and draws the window. False once the user has closed it. Errors: INTERNAL (GL).
  [[nodiscard]] absl::StatusOr<bool> Frame();
  // The picture shows the state, and nothing is on its way.
  [[nodiscard]] bool IsSettled() const;
  // As a click on it.
  void Select(const std::string& name);
  // The window as it was drawn last, 8-bit sRGB. Errors: those of WriteFileAtomically, INTERNAL (GL).
  [[nodiscard]] absl::Status WriteScreenshot(const std::string& path);

  [[nodiscard]] ViewerState& state() { return *state_; }
  // The last one, once its picture is there.
  [[nodiscard]] const std::optional<Redressing>& redressing() const { return redressing_; }
  [[nodiscard]] const ViewFacts& facts() const { return facts_; }

 private:
  using Clock = std::chrono::steady_clock;
  // What a picture depends on; another one is asked for when it changes.
  struct Shown {
    std::shared_ptr<const Dressing> dressing;
    std::shared_ptr<const TileSet> tile_set;
    Eigen::Vector3d eye{0, 0, 0};
    Eigen::Vector3d target{0, 0, 0};
    Eigen::Vector3d light{0, 0, 0};
    double strength = 0.0;
    Sky sky;
    Tone tone;
    int width = 0;
    int height = 0;
    bool operator==(const Shown&) const = default;
  };
  struct Click {
    std::string tile_set;
    Clock::time_point time;
    int pictures = 0;
  };

  explicit App(Display& display) : display_(display) {}
  void TakeLoaded();
  void TakePictures();
  void TakePicture(ScenePicture picture);
  void NoteClick();
  void FinishClick(const ScenePicture& picture);
  void DrawPanels();
  void AskForPicture();
  void MeasureFrame();

  Display& display_;
  GlState* gl_state_ = nullptr;
  std::unique_ptr<GuiRenderer> gui_;
  std::unique_ptr<GuiTexture> picture_;
  std::map<std::string, std::unique_ptr<GuiTexture>> thumbnails_;  // by digest
  std::unique_ptr<Loader> loader_;
  std::unique_ptr<ViewerState> state_;
  std::unique_ptr<SceneView> scene_;
  ViewFacts facts_;
  ImVec2 scene_size_{0.0F, 0.0F};
  Shown asked_;
  std::string selected_before_;
  std::optional<Click> click_;
  std::optional<Redressing> redressing_;
  std::deque<Clock::time_point> frame_times_;
};

}  // namespace tessera::viewer
