#include "viewer/gui_renderer.h"

#include <algorithm>
#include <cstddef>

#include <absl/memory/memory.h>

#include "btf/base/status_macros.h"
#include "btf/image/transfer.h"

namespace tessera::viewer {
namespace {

constexpr char kVertexShader[] = R"(#version 450 core
layout(location = 0) in vec2 place;
layout(location = 1) in vec2 uv;
layout(location = 2) in vec4 colour;
uniform vec4 display;  // left, top, 2 / width, -2 / height
out vec2 fragment_uv;
out vec4 fragment_colour;
void main() {
  fragment_uv = uv;
  fragment_colour = colour;
  gl_Position = vec4((place - display.xy) * display.zw + vec2(-1.0, 1.0), 0.0, 1.0);
}
)";

constexpr char kFragmentShader[] = R"(#version 450 core
in vec2 fragment_uv;
in vec4 fragment_colour;
layout(binding = 0) uniform sampler2D picture;
out vec4 result;
void main() { result = fragment_colour * texture(picture, fragment_uv); }
)";

constexpr GLenum kIndexType = sizeof(ImDrawIdx) == 2 ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT;

const void* Offset(size_t bytes) {
  return reinterpret_cast<const void*>(bytes);
}

}  // namespace

GuiTexture::GuiTexture(const GladGLContext& gl, int width, int height, std::span<const uint8_t> rgba)
    : gl_(gl), texture_(gl) {
  gl_.BindTexture(GL_TEXTURE_2D, texture_.name());
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  gl_.TexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  Fill(width, height, rgba);
}

void GuiTexture::Fill(int width, int height, std::span<const uint8_t> rgba) {
  gl_.BindTexture(GL_TEXTURE_2D, texture_.name());
  gl_.PixelStorei(GL_UNPACK_ALIGNMENT, 1);
  if (width == width_ && height == height_) {
    gl_.TexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
  } else {
    gl_.TexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width, height, 0, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
  }
  width_ = width;
  height_ = height;
}

ImTextureID GuiTexture::id() const {
  return reinterpret_cast<ImTextureID>(static_cast<uintptr_t>(texture_.name()));
}

GuiRenderer::GuiRenderer(GlState& state, GLuint program)
    : state_(state), gl_(state.gl), program_(program), vertex_array_(gl_), vertices_(gl_), indices_(gl_) {}

absl::StatusOr<std::unique_ptr<GuiRenderer>> GuiRenderer::Create(GlState& state) {
  TESSERA_ASSIGN_OR_RETURN(const GLuint program, state.Program(kVertexShader, kFragmentShader));
  auto renderer = absl::WrapUnique(new GuiRenderer(state, program));
  renderer->MakeFonts();
  ImGui::GetIO().BackendFlags |= ImGuiBackendFlags_RendererHasVtxOffset;
  TESSERA_RETURN_IF_ERROR(state.CheckError("the interface's fonts"));
  return renderer;
}

void GuiRenderer::MakeFonts() {
  unsigned char* pixels = nullptr;
  int width = 0;
  int height = 0;
  ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
  atlas.GetTexDataAsRGBA32(&pixels, &width, &height);
  fonts_ = std::make_unique<GuiTexture>(gl_, width, height,
                                        std::span(pixels, static_cast<size_t>(width) * height * 4));
  atlas.SetTexID(fonts_->id());
  gl_.BindVertexArray(vertex_array_.name());
  gl_.BindBuffer(GL_ARRAY_BUFFER, vertices_.name());
  gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_.name());
  constexpr GLsizei kStride = sizeof(ImDrawVert);
  gl_.VertexAttribPointer(0, 2, GL_FLOAT, GL_FALSE, kStride, Offset(offsetof(ImDrawVert, pos)));
  gl_.VertexAttribPointer(1, 2, GL_FLOAT, GL_FALSE, kStride, Offset(offsetof(ImDrawVert, uv)));
  gl_.VertexAttribPointer(2, 4, GL_UNSIGNED_BYTE, GL_TRUE, kStride, Offset(offsetof(ImDrawVert, col)));
  for (GLuint i = 0; i < 3; ++i) {
    gl_.EnableVertexAttribArray(i);
  }
}

absl::Status GuiRenderer::Draw(const ImDrawData& data, unsigned framebuffer, int width, int height) {
  gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  gl_.Viewport(0, 0, width, height);
  gl_.Disable(GL_SCISSOR_TEST);
  gl_.ClearColor(0.06F, 0.06F, 0.07F, 1.0F);
  gl_.Clear(GL_COLOR_BUFFER_BIT);
  gl_.Disable(GL_DEPTH_TEST);
  gl_.Disable(GL_CULL_FACE);
  gl_.Enable(GL_SCISSOR_TEST);
  gl_.Enable(GL_BLEND);
  gl_.BlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
  gl_.UseProgram(program_);
  gl_.Uniform4f(gl_.GetUniformLocation(program_, "display"), data.DisplayPos.x, data.DisplayPos.y,
                2.0F / std::max(data.DisplaySize.x, 1.0F), -2.0F / std::max(data.DisplaySize.y, 1.0F));
  gl_.BindVertexArray(vertex_array_.name());
  gl_.ActiveTexture(GL_TEXTURE0);
  for (int i = 0; i < data.CmdListsCount; ++i) {
    DrawList(*data.CmdLists[i], data, height);
  }
  gl_.Disable(GL_SCISSOR_TEST);
  return state_.CheckError("drawing the interface");
}

void GuiRenderer::DrawList(const ImDrawList& list, const ImDrawData& data, int height) {
  gl_.BindBuffer(GL_ARRAY_BUFFER, vertices_.name());
  gl_.BufferData(GL_ARRAY_BUFFER, list.VtxBuffer.size_in_bytes(), list.VtxBuffer.Data, GL_STREAM_DRAW);
  gl_.BufferData(GL_ELEMENT_ARRAY_BUFFER, list.IdxBuffer.size_in_bytes(), list.IdxBuffer.Data,
                 GL_STREAM_DRAW);
  const auto pixel_x = [&](float x) { return (x - data.DisplayPos.x) * data.FramebufferScale.x; };
  const auto pixel_y = [&](float y) { return (y - data.DisplayPos.y) * data.FramebufferScale.y; };
  for (const ImDrawCmd& command : list.CmdBuffer) {
    if (command.UserCallback != nullptr) {
      continue;  // none of the panels has any
    }
    const float left = pixel_x(command.ClipRect.x);
    const float top = pixel_y(command.ClipRect.y);
    const float right = pixel_x(command.ClipRect.z);
    const float bottom = pixel_y(command.ClipRect.w);
    if (right <= left || bottom <= top) {
      continue;
    }
    gl_.Scissor(static_cast<GLint>(left), static_cast<GLint>(static_cast<float>(height) - bottom),
                static_cast<GLsizei>(right - left), static_cast<GLsizei>(bottom - top));
    gl_.BindTexture(GL_TEXTURE_2D, static_cast<GLuint>(reinterpret_cast<uintptr_t>(command.GetTexID())));
    gl_.DrawElementsBaseVertex(GL_TRIANGLES, static_cast<GLsizei>(command.ElemCount), kIndexType,
                               Offset(command.IdxOffset * sizeof(ImDrawIdx)),
                               static_cast<GLint>(command.VtxOffset));
  }
}

absl::StatusOr<Image> GuiRenderer::Read(unsigned framebuffer, int width, int height) const {
  std::vector<uint8_t> codes(static_cast<size_t>(width) * height * 3);
  gl_.BindFramebuffer(GL_FRAMEBUFFER, framebuffer);
  gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
  gl_.ReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, codes.data());
  TESSERA_RETURN_IF_ERROR(state_.CheckError("reading the framebuffer"));
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y) {
    const uint8_t* const row = codes.data() + static_cast<size_t>(height - 1 - y) * width * 3;
    std::transform(row, row + static_cast<size_t>(width) * 3, image.at(0, y),
                   [](uint8_t code) { return static_cast<float>(LinearFromSrgb(code / 255.0)); });
  }
  return image;
}

}  // namespace tessera::viewer
