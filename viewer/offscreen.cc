#include <utility>

#include <imgui.h>

#include "btf/base/status_macros.h"
#include "btf/render/gl_state.h"
#include "viewer/display.h"

namespace tessera::viewer {
namespace {

class OffscreenDisplay final : public Display {
 public:
  OffscreenDisplay(std::unique_ptr<OffscreenContext> gui, std::unique_ptr<OffscreenContext> scene, int width,
                   int height)
      : gui_(std::move(gui)), scene_(std::move(scene)), width_(width), height_(height) {}

  ~OffscreenDisplay() override {
    framebuffer_.reset();
    pixels_.reset();
    gui_->Release();
  }

  absl::Status Begin() {
    TESSERA_RETURN_IF_ERROR(gui_->MakeCurrent());
    TESSERA_ASSIGN_OR_RETURN(GlState* const state, gui_->gl_state());
    const GladGLContext& gl = state->gl;
    pixels_ = std::make_unique<GlTexture>(gl);
    gl.BindTexture(GL_TEXTURE_2D, pixels_->name());
    gl.TexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA8, width_, height_);
    framebuffer_ = std::make_unique<GlFramebuffer>(gl);
    gl.BindFramebuffer(GL_FRAMEBUFFER, framebuffer_->name());
    gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, pixels_->name(), 0);
    if (gl.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
      return absl::InternalError("GL offers no RGBA8 framebuffer");
    }
    return state->CheckError("the interface's framebuffer");
  }

  OffscreenContext& gui_context() override { return *gui_; }
  OffscreenContext& scene_context() override { return *scene_; }
  bool BeginFrame(bool /*is_busy*/) override {
    ImGuiIO& io = ImGui::GetIO();
    io.DisplaySize = ImVec2(static_cast<float>(width_), static_cast<float>(height_));
    io.DeltaTime = 1.0F / 60.0F;
    return true;
  }
  bool is_watched() const override { return false; }
  unsigned framebuffer() const override { return framebuffer_->name(); }
  int width() const override { return width_; }
  int height() const override { return height_; }
  void EndFrame() override {}
  std::function<void()> waker() const override {
    return [] {};
  }

 private:
  std::unique_ptr<OffscreenContext> gui_;
  std::unique_ptr<OffscreenContext> scene_;
  const int width_;
  const int height_;
  std::unique_ptr<GlTexture> pixels_;
  std::unique_ptr<GlFramebuffer> framebuffer_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Display>> OpenOffscreen(int width, int height) {
  TESSERA_ASSIGN_OR_RETURN(auto gui, CreateOsmesaContext());
  TESSERA_ASSIGN_OR_RETURN(auto scene, CreateOsmesaContext());
  auto display = std::make_unique<OffscreenDisplay>(std::move(gui), std::move(scene), width, height);
  TESSERA_RETURN_IF_ERROR(display->Begin());
  return std::unique_ptr<Display>(std::move(display));
}

}  // namespace tessera::viewer
