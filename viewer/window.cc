#include <string>
#include <string_view>
#include <utility>

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <absl/strings/str_cat.h>
#include <backends/imgui_impl_glfw.h>
#include <imgui.h>

#include "btf/base/status_macros.h"
#include "btf/render/gl_state.h"
#include "viewer/display.h"

namespace tessera::viewer {
namespace {

// While nothing happens the window is drawn again this often.
constexpr double kIdleWait_s = 0.25;
constexpr double kBusyWait_s = 0.01;

absl::Status GlfwError(const char* what) {
  const char* text = nullptr;
  glfwGetError(&text);
  return absl::UnavailableError(absl::StrCat(what, ": ", text == nullptr ? "GLFW does not say why" : text));
}

class GlfwContext final : public OffscreenContext {
 public:
  explicit GlfwContext(GLFWwindow* window) : window_(window) {}
  ~GlfwContext() override {
    if (MakeCurrent().ok()) {
      DestroyGlState();
      Release();
    }
    glfwDestroyWindow(window_);
  }

  absl::Status MakeCurrent() override {
    glfwMakeContextCurrent(window_);
    return glfwGetCurrentContext() == window_ ? absl::OkStatus() : GlfwError("no OpenGL context");
  }
  void Release() override { glfwMakeContextCurrent(nullptr); }
  Procedure GetProcAddress(const char* name) const override { return glfwGetProcAddress(name); }
  std::string Description() const override { return absl::StrCat("GLFW ", glfwGetVersionString()); }
  [[nodiscard]] GLFWwindow* window() const { return window_; }

 private:
  GLFWwindow* const window_;
};

absl::StatusOr<std::unique_ptr<GlfwContext>> MakeGlfwContext(int width, int height, const std::string& title,
                                                             bool is_visible) {
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 4);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 5);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  glfwWindowHint(GLFW_VISIBLE, is_visible ? GLFW_TRUE : GLFW_FALSE);
  GLFWwindow* const window = glfwCreateWindow(width, height, title.c_str(), nullptr, nullptr);
  if (window == nullptr) {
    return GlfwError("no window with OpenGL 4.5");
  }
  return std::make_unique<GlfwContext>(window);
}

// GLFW itself, for as long as there are windows.
class GlfwLibrary {
 public:
  GlfwLibrary() : is_there_(glfwInit() == GLFW_TRUE) {}
  ~GlfwLibrary() { glfwTerminate(); }
  GlfwLibrary(const GlfwLibrary&) = delete;
  GlfwLibrary& operator=(const GlfwLibrary&) = delete;
  [[nodiscard]] bool is_there() const { return is_there_; }

 private:
  const bool is_there_;
};

class WindowDisplay final : public Display {
 public:
  ~WindowDisplay() override {
    if (has_gui_) {
      ImGui_ImplGlfw_Shutdown();
    }
  }

  absl::Status Begin(int width, int height, const std::string& title) {
    if (!library_.is_there()) {
      return GlfwError("no window");
    }
    TESSERA_ASSIGN_OR_RETURN(gui_, MakeGlfwContext(width, height, title, true));
    TESSERA_RETURN_IF_ERROR(gui_->MakeCurrent());
    TESSERA_ASSIGN_OR_RETURN(scene_, MakeSceneContext(title));
    glfwSwapInterval(1);
    has_gui_ = ImGui_ImplGlfw_InitForOpenGL(gui_->window(), true);
    return absl::OkStatus();
  }

  OffscreenContext& gui_context() override { return *gui_; }
  OffscreenContext& scene_context() override { return *scene_; }
  bool BeginFrame(bool is_busy) override {
    glfwWaitEventsTimeout(is_busy ? kBusyWait_s : kIdleWait_s);
    ImGui_ImplGlfw_NewFrame();
    return !glfwWindowShouldClose(gui_->window());
  }
  bool is_watched() const override { return true; }
  unsigned framebuffer() const override { return 0; }
  int width() const override { return Size().first; }
  int height() const override { return Size().second; }
  void EndFrame() override { glfwSwapBuffers(gui_->window()); }
  std::function<void()> waker() const override {
    return [] { glfwPostEmptyEvent(); };
  }

 private:
  // llvmpipe draws for all contexts of a display with the same threads, one after the other: frames of the
  // interface would keep the scene waiting. OSMesa has threads of its own.
  absl::StatusOr<std::unique_ptr<OffscreenContext>> MakeSceneContext(const std::string& title) {
    TESSERA_ASSIGN_OR_RETURN(GlState* const state, gui_->gl_state());
    const auto* const renderer = reinterpret_cast<const char*>(state->gl.GetString(GL_RENDERER));
    if (renderer != nullptr && std::string_view(renderer).find("llvmpipe") != std::string_view::npos) {
      // OSMesa unbinds what is current, behind GLFW's back.
      gui_->Release();
      TESSERA_ASSIGN_OR_RETURN(auto osmesa, CreateOsmesaContext());
      TESSERA_RETURN_IF_ERROR(gui_->MakeCurrent());
      return osmesa;
    }
    return MakeGlfwContext(16, 16, title, false);
  }

  [[nodiscard]] std::pair<int, int> Size() const {
    std::pair<int, int> size;
    glfwGetFramebufferSize(gui_->window(), &size.first, &size.second);
    return size;
  }

  const GlfwLibrary library_;
  std::unique_ptr<GlfwContext> gui_;
  std::unique_ptr<OffscreenContext> scene_;
  bool has_gui_ = false;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Display>> OpenWindow(int width, int height, const std::string& title) {
  auto display = std::make_unique<WindowDisplay>();
  TESSERA_RETURN_IF_ERROR(display->Begin(width, height, title));
  return std::unique_ptr<Display>(std::move(display));
}

}  // namespace tessera::viewer
