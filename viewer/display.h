// Where the viewer is seen: a window, or memory. Both give two GL 4.5 contexts, one for the interface and one
// for the scene's thread, and a framebuffer to draw the interface into.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "btf/render/offscreen_context.h"

namespace tessera::viewer {

// Of the main thread. An ImGui context must exist before and outlive it.
class Display {
 public:
  virtual ~Display() = default;
  // Current on the main thread all the time.
  [[nodiscard]] virtual OffscreenContext& gui_context() = 0;
  // For another thread.
  [[nodiscard]] virtual OffscreenContext& scene_context() = 0;
  // Tells ImGui of size, time and input. `is_busy`: the picture may change without input, so it does not wait
  // for any. False once the user has closed the window.
  [[nodiscard]] virtual bool BeginFrame(bool is_busy) = 0;
  // Whether somebody looks at every frame; else the interface is drawn for screenshots only.
  [[nodiscard]] virtual bool is_watched() const = 0;
  // GL name of the framebuffer, and its size.
  [[nodiscard]] virtual unsigned framebuffer() const = 0;
  [[nodiscard]] virtual int width() const = 0;
  [[nodiscard]] virtual int height() const = 0;
  // Shows what was drawn.
  virtual void EndFrame() = 0;
  // Ends the wait of BeginFrame; thread-safe.
  [[nodiscard]] virtual std::function<void()> waker() const = 0;
};

// A GLFW window. Errors: UNAVAILABLE with what GLFW says (no display, no OpenGL 4.5).
[[nodiscard]] absl::StatusOr<std::unique_ptr<Display>> OpenWindow(int width, int height,
                                                                  const std::string& title);

// Pixels in memory, drawn by OSMesa; time passes by a sixtieth of a second a frame. Errors: those of
// CreateOsmesaContext.
[[nodiscard]] absl::StatusOr<std::unique_ptr<Display>> OpenOffscreen(int width, int height);

}  // namespace tessera::viewer
