#include "btf/render/gl_state.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

namespace tessera {
namespace {

// How many programs a context keeps: one a codec size and material of unusual tables.
constexpr size_t kMaxPrograms = 32;

absl::StatusOr<GLuint> Compile(const GladGLContext& gl, GLenum kind, const std::string& source) {
  const GLuint shader = gl.CreateShader(kind);
  const char* text = source.c_str();
  gl.ShaderSource(shader, 1, &text, nullptr);
  gl.CompileShader(shader);
  GLint compiled = 0;
  gl.GetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  if (!compiled) {
    std::string log(4096, '\0');
    GLsizei length = 0;
    gl.GetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), &length, log.data());
    log.resize(length);
    gl.DeleteShader(shader);
    return absl::InternalError(
        absl::StrCat(kind == GL_VERTEX_SHADER ? "vertex" : "fragment", " shader does not compile: ", log));
  }
  return shader;
}

}  // namespace

GlState::~GlState() {
  MakeRoom(kMaxPrograms);
}

void GlState::MakeRoom(size_t count) {
  if (programs_.size() + count <= kMaxPrograms) {
    return;
  }
  for (const auto& [source, program] : programs_) {
    gl.DeleteProgram(program);
  }
  programs_.clear();
}

absl::StatusOr<GLuint> GlState::Program(const std::string& vertex_source,
                                        const std::string& fragment_source) {
  const std::string key = absl::StrCat(vertex_source, "\n//----\n", fragment_source);
  if (const auto found = programs_.find(key); found != programs_.end()) {
    return found->second;
  }
  const absl::StatusOr<GLuint> vertex = Compile(gl, GL_VERTEX_SHADER, vertex_source);
  if (!vertex.ok()) {
    return vertex.status();
  }
  const absl::StatusOr<GLuint> fragment = Compile(gl, GL_FRAGMENT_SHADER, fragment_source);
  if (!fragment.ok()) {
    gl.DeleteShader(*vertex);
    return fragment.status();
  }
  const GLuint program = gl.CreateProgram();
  for (const GLuint shader : {*vertex, *fragment}) {
    gl.AttachShader(program, shader);
    gl.DeleteShader(shader);
  }
  gl.LinkProgram(program);
  GLint linked = 0;
  gl.GetProgramiv(program, GL_LINK_STATUS, &linked);
  if (!linked) {
    std::string log(4096, '\0');
    GLsizei length = 0;
    gl.GetProgramInfoLog(program, static_cast<GLsizei>(log.size()), &length, log.data());
    log.resize(length);
    gl.DeleteProgram(program);
    return absl::InternalError(absl::StrCat("GL program does not link: ", log));
  }
  MakeRoom(1);
  programs_.emplace(key, program);
  return program;
}

absl::Status GlState::CheckError(const char* where) const {
  const GLenum error = gl.GetError();
  if (error == GL_NO_ERROR) {
    return absl::OkStatus();
  }
  if (error == GL_OUT_OF_MEMORY) {
    return absl::ResourceExhaustedError(absl::StrCat("GL is out of memory at ", where));
  }
  return absl::InternalError(absl::StrCat("GL error 0x", absl::Hex(error), " at ", where));
}

}  // namespace tessera
