// Draws ImGui's draw lists through glad's table of the current context. (ImGui's own OpenGL 3 backend loads
// GL from libGL, which knows no OSMesa context.)
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <imgui.h>

#include "btf/image/image.h"
#include "btf/render/gl_state.h"

namespace tessera::viewer {

// An RGBA8 picture for ImGui::Image. The context must be current whenever it is used.
class GuiTexture {
 public:
  GuiTexture(const GladGLContext& gl, int width, int height, std::span<const uint8_t> rgba);
  // `rgba` is [height][width][4], row 0 on top.
  void Fill(int width, int height, std::span<const uint8_t> rgba);
  [[nodiscard]] ImTextureID id() const;

 private:
  const GladGLContext& gl_;
  GlTexture texture_;
  int width_ = 0;
  int height_ = 0;
};

// Of the main thread, for the current ImGui context.
class GuiRenderer {
 public:
  // `state` must outlive it; its context must be current whenever it is used. Errors: INTERNAL (GL).
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<GuiRenderer>> Create(GlState& state);

  // Clears the framebuffer and draws over it.
  [[nodiscard]] absl::Status Draw(const ImDrawData& data, unsigned framebuffer, int width, int height);
  // What the framebuffer shows, RGB, linear.
  [[nodiscard]] absl::StatusOr<Image> Read(unsigned framebuffer, int width, int height) const;

 private:
  GuiRenderer(GlState& state, GLuint program);
  void MakeFonts();
  void DrawList(const ImDrawList& list, const ImDrawData& data, int height);

  GlState& state_;
  const GladGLContext& gl_;
  const GLuint program_;
  GlVertexArray vertex_array_;
  GlBuffer vertices_;
  GlBuffer indices_;
  std::unique_ptr<GuiTexture> fonts_;
};

}  // namespace tessera::viewer
