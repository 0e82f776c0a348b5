#include "viewer/app.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include <absl/memory/memory.h>
#include <absl/strings/str_cat.h>
#include <Eigen/Geometry>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"

namespace tessera::viewer {
namespace {

constexpr float kLeftWidth = 270.0F;
constexpr float kRightWidth = 300.0F;
constexpr float kLightHeight = 380.0F;
constexpr size_t kFramesMeasured = 30;
constexpr char kPictureSubject[] = "picture";

struct Layout {
  Rectangle tile_sets;
  Rectangle scene;
  Rectangle facts;
  Rectangle light;
};

Layout LayOut(ImVec2 display) {
  const float scene_width = std::max(display.x - kLeftWidth - kRightWidth, 64.0F);
  const float right = kLeftWidth + scene_width;
  const float facts_height = std::max(display.y - kLightHeight, 64.0F);
  return {{ImVec2(0.0F, 0.0F), ImVec2(kLeftWidth, display.y)},
          {ImVec2(kLeftWidth, 0.0F), ImVec2(scene_width, display.y)},
          {ImVec2(right, 0.0F), ImVec2(kRightWidth, facts_height)},
          {ImVec2(right, facts_height), ImVec2(kRightWidth, kLightHeight)}};
}

std::optional<FrequencyLight> Turned(const Sky& sky) {
  if (sky.light == nullptr) {
    return std::nullopt;
  }
  const Eigen::AngleAxisd turn(sky.azimuth_rad, Eigen::Vector3d::UnitY());
  return FrequencyLight(sky.strength * sky.light->InFrame(turn.toRotationMatrix()));
}

double MsBetween(std::chrono::steady_clock::time_point begin, std::chrono::steady_clock::time_point end) {
  return std::chrono::duration<double, std::milli>(end - begin).count();
}

}  // namespace

absl::StatusOr<std::unique_ptr<App>> App::Create(Display& display, std::unique_ptr<Source> source,
                                                 ViewerOptions options) {
  auto app = absl::WrapUnique(new App(display));
  TESSERA_ASSIGN_OR_RETURN(app->gl_state_, display.gui_context().gl_state());
  TESSERA_ASSIGN_OR_RETURN(app->gui_, GuiRenderer::Create(*app->gl_state_));
  app->loader_ = std::make_unique<Loader>(std::move(source), display.waker());
  app->state_ = std::make_unique<ViewerState>(*app->loader_, std::move(options));
  app->scene_ = std::make_unique<SceneView>(display.scene_context(), display.waker());
  app->state_->Begin();
  return app;
}

App::~App() = default;

absl::StatusOr<bool> App::Frame() {
  if (!display_.BeginFrame(!IsSettled())) {
    return false;
  }
  MeasureFrame();
  const ImVec2 scale = ImGui::GetIO().DisplayFramebufferScale;
  const ImVec2 scene = LayOut(ImGui::GetIO().DisplaySize).scene.size;
  state_->SetSceneSize(static_cast<int>(scene.x * scale.x), static_cast<int>(scene.y * scale.y));
  TakeLoaded();
  TakePictures();
  ImGui::NewFrame();
  DrawPanels();
  ImGui::Render();
  NoteClick();
  AskForPicture();
  if (display_.is_watched()) {
    TESSERA_RETURN_IF_ERROR(
        gui_->Draw(*ImGui::GetDrawData(), display_.framebuffer(), display_.width(), display_.height()));
    display_.EndFrame();
  }
  return true;
}

void App::TakeLoaded() {
  for (LoadEvent& event : loader_->Take()) {
    state_->Apply(std::move(event));
  }
  for (const auto& [sha256, pixels] : state_->TakeThumbnails()) {
    thumbnails_[sha256] =
        std::make_unique<GuiTexture>(gl_state_->gl, pixels.width, pixels.height, pixels.rgba);
  }
  facts_.activity = loader_->Activity();
}

void App::TakePictures() {
  if (std::optional<ScenePicture> picture = scene_->TakePicture()) {
    TakePicture(*std::move(picture));
  }
  facts_.is_drawing = !scene_->IsIdle();
}

void App::TakePicture(ScenePicture picture) {
  if (!picture.status.ok()) {
    state_->Tell(
        {true, absl::StrCat("no picture: ", std::string(picture.status.message())), kPictureSubject});
    return;
  }
  state_->DismissMessage(kPictureSubject);
  const Pixels& pixels = picture.pixels;
  if (picture_ == nullptr) {
    picture_ = std::make_unique<GuiTexture>(gl_state_->gl, pixels.width, pixels.height, pixels.rgba);
  } else {
    picture_->Fill(pixels.width, pixels.height, pixels.rgba);
  }
  facts_.draw_ms = picture.draw_ms;
  facts_.texels_per_pixel = picture.texels_per_pixel;
  facts_.mips = picture.mips;
  facts_.why_no_mips = picture.why_no_mips;
  if (picture.prepare_ms > 0.0) {
    facts_.prepare_ms = picture.prepare_ms;
  }
  FinishClick(picture);
}

void App::Select(const std::string& name) {
  state_->Select(name);
  NoteClick();
}

void App::NoteClick() {
  if (state_->selected() != selected_before_) {
    selected_before_ = state_->selected();
    click_ = Click{selected_before_, Clock::now()};
  }
}

void App::FinishClick(const ScenePicture& picture) {
  if (!click_.has_value()) {
    return;
  }
  ++click_->pictures;
  if (state_->shown_name() != click_->tile_set || picture.tile_set != state_->shown()) {
    return;
  }
  const double total_ms = MsBetween(click_->time, Clock::now());
  redressing_ = Redressing{.tile_set = click_->tile_set,
                           .was_cached = state_->load_ms() == 0.0 && picture.prepare_ms == 0.0,
                           .pictures = click_->pictures,
                           .load_ms = state_->load_ms(),
                           .prepare_ms = picture.prepare_ms,
                           .draw_ms = picture.draw_ms,
                           .total_ms = total_ms};
  facts_.redress_ms = total_ms;
  facts_.redress_was_cached = redressing_->was_cached;
  click_.reset();
}

void App::DrawPanels() {
  const Layout layout = LayOut(ImGui::GetIO().DisplaySize);
  scene_size_ = DrawScenePanel(layout.scene, *state_, picture_.get());
  DrawTileSetPanel(layout.tile_sets, *state_, thumbnails_);
  DrawFactsPanel(layout.facts, *state_, facts_);
  DrawLightPanel(layout.light, *state_);
  DrawMessagesPanel(layout.scene, *state_);
}

void App::AskForPicture() {
  if (state_->dressing() == nullptr || state_->shown() == nullptr) {
    return;
  }
  const Camera camera = state_->camera.camera();
  const Light light = state_->light.light();
  const Shown wanted{.dressing = state_->dressing(),
                     .tile_set = state_->shown(),
                     .eye = camera.eye,
                     .target = camera.target,
                     .light = light.place,
                     .strength = state_->light.strength,
                     .sky = state_->sky,
                     .tone = state_->tone,
                     .width = static_cast<int>(scene_size_.x),
                     .height = static_cast<int>(scene_size_.y)};
  if (wanted == asked_) {
    return;
  }
  asked_ = wanted;
  scene_->Ask({.dressing = state_->dressing(),
               .tile_set = state_->shown(),
               .camera = camera,
               .lights = state_->light.strength > 0.0 ? std::vector<Light>{light} : std::vector<Light>{},
               .sky = Turned(state_->sky),
               .tone = state_->tone,
               .width = wanted.width,
               .height = wanted.height});
}

bool App::IsSettled() const {
  return loader_->IsIdle() && scene_->IsIdle() && !facts_.is_drawing;
}

void App::MeasureFrame() {
  frame_times_.push_back(Clock::now());
  if (frame_times_.size() > kFramesMeasured) {
    frame_times_.pop_front();
  }
  if (frame_times_.size() > 1) {
    facts_.frame_ms =
        MsBetween(frame_times_.front(), frame_times_.back()) / static_cast<double>(frame_times_.size() - 1);
  }
}

absl::Status App::WriteScreenshot(const std::string& path) {
  TESSERA_RETURN_IF_ERROR(
      gui_->Draw(*ImGui::GetDrawData(), display_.framebuffer(), display_.width(), display_.height()));
  TESSERA_ASSIGN_OR_RETURN(const Image image,
                           gui_->Read(display_.framebuffer(), display_.width(), display_.height()));
  TESSERA_ASSIGN_OR_RETURN(const std::string png, EncodePng(image));
  return WriteFileAtomically(path, png);
}

}  // namespace tessera::viewer
