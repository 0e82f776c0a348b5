// What one GL context holds for us: its function table and its compiled programs.
#pragma once

#include <map>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <glad/gl.h>

namespace tessera {

class GlState {
 public:
  explicit GlState(const GladGLContext& functions) : gl(functions) {}
  GlState(const GlState&) = delete;
  GlState& operator=(const GlState&) = delete;
  // The context must be current.
  ~GlState();

  // The linked program of these two sources, compiled on first use and kept; when the context
  // is full, all others are dropped. Errors: INTERNAL with the
  // driver's log.
  [[nodiscard]] absl::StatusOr<GLuint> Program(const std::string& vertex_source,
                                               const std::string& fragment_source);

  // Drops all programs unless there is room for `count` more: those that are asked for next stay.
  void MakeRoom(size_t count);

  // INTERNAL naming `where` and the GL error, if one is pending.
  [[nodiscard]] absl::Status CheckError(const char* where) const;

  const GladGLContext gl;

 private:
  std::map<std::string, GLuint> programs_;  // by both sources
};

// Owners of GL names. The context that made them must be current when they go.
template <auto Generate, auto Delete>
class GlObject {
 public:
  explicit GlObject(const GladGLContext& gl) : gl_(&gl) { (gl.*Generate)(1, &name_); }
  GlObject(const GlObject&) = delete;
  GlObject& operator=(const GlObject&) = delete;
  ~GlObject() { (gl_->*Delete)(1, &name_); }
  [[nodiscard]] GLuint name() const { return name_; }

 private:
  const GladGLContext* gl_;
  GLuint name_ = 0;
};

using GlBuffer = GlObject<&GladGLContext::GenBuffers, &GladGLContext::DeleteBuffers>;
using GlTexture = GlObject<&GladGLContext::GenTextures, &GladGLContext::DeleteTextures>;
using GlFramebuffer = GlObject<&GladGLContext::GenFramebuffers, &GladGLContext::DeleteFramebuffers>;
using GlRenderbuffer = GlObject<&GladGLContext::GenRenderbuffers, &GladGLContext::DeleteRenderbuffers>;
using GlVertexArray = GlObject<&GladGLContext::GenVertexArrays, &GladGLContext::DeleteVertexArrays>;

}  // namespace tessera
