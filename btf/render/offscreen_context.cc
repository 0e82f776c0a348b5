#include "btf/render/offscreen_context.h"

#include "btf/render/gl_state.h"

namespace tessera {

OffscreenContext::OffscreenContext() = default;
OffscreenContext::~OffscreenContext() = default;

absl::StatusOr<GlState*> OffscreenContext::gl_state() {
  if (gl_state_ == nullptr) {
    GladGLContext functions = {};
    const auto load = [](void* self, const char* name) -> GLADapiproc {
      return static_cast<OffscreenContext*>(self)->GetProcAddress(name);
    };
    const int version = gladLoadGLContextUserPtr(&functions, load, this);
    if (GLAD_VERSION_MAJOR(version) * 10 + GLAD_VERSION_MINOR(version) < 45) {
      return absl::InternalError("the context offers less than OpenGL 4.5");
    }
    gl_state_ = std::make_unique<GlState>(functions);
  }
  return gl_state_.get();
}

void OffscreenContext::DestroyGlState() {
  gl_state_.reset();
}

}  // namespace tessera
