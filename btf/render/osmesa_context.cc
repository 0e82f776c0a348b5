#include <array>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

// osmesa.h brings GL/gl.h; the GL functions themselves come from glad's table, in other files.
#include <GL/osmesa.h>

#include "btf/base/status_macros.h"
#include "btf/render/offscreen_context.h"

namespace tessera {
namespace {

class OsmesaContext final : public OffscreenContext {
 public:
  explicit OsmesaContext(OSMesaContext context) : context_(context) {}

  ~OsmesaContext() override {
    if (MakeCurrent().ok()) {
      DestroyGlState();
      Release();
    }
    OSMesaDestroyContext(context_);
  }

  absl::Status MakeCurrent() override {
    if (!OSMesaMakeCurrent(context_, pixels_.data(), GL_UNSIGNED_BYTE, kSide, kSide)) {
      return absl::InternalError("OSMesaMakeCurrent refused the context");
    }
    return absl::OkStatus();
  }

  void Release() override { OSMesaMakeCurrent(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0); }

  Procedure GetProcAddress(const char* name) const override { return OSMesaGetProcAddress(name); }

  std::string Description() const override { return description_; }

  // Reads the renderer's strings; the context must be current.
  absl::Status Describe() {
    using GetString = const GLubyte* (*)(GLenum);
    const auto get_string = reinterpret_cast<GetString>(OSMesaGetProcAddress("glGetString"));
    if (get_string == nullptr) {
      return absl::UnavailableError("OSMesa offers no glGetString");
    }
    const auto text = [&](GLenum which) {
      const GLubyte* string = get_string(which);
      return string == nullptr ? std::string("?") : std::string(reinterpret_cast<const char*>(string));
    };
    description_ = absl::StrCat("OSMesa, ", text(GL_RENDERER), ", ", text(GL_VERSION));
    return absl::OkStatus();
  }

 private:
  // Everything renders to framebuffer objects; OSMesa still wants a default framebuffer of some size.
  static constexpr int kSide = 16;

  OSMesaContext context_;
  std::array<unsigned char, kSide* kSide* 4> pixels_ = {};
  std::string description_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<OffscreenContext>> CreateOsmesaContext() {
  // OSMesa of Mesa 22 refuses 4.6 but gives 4.5.
  const std::array<int, 13> attributes = {OSMESA_FORMAT,
                                          OSMESA_RGBA,
                                          OSMESA_DEPTH_BITS,
                                          0,
                                          OSMESA_STENCIL_BITS,
                                          0,
                                          OSMESA_PROFILE,
                                          OSMESA_CORE_PROFILE,
                                          OSMESA_CONTEXT_MAJOR_VERSION,
                                          4,
                                          OSMESA_CONTEXT_MINOR_VERSION,
                                          5,
                                          0};
  const OSMesaContext handle = OSMesaCreateContextAttribs(attributes.data(), nullptr);
  if (handle == nullptr) {
    return absl::UnavailableError("OSMesa offers no OpenGL 4.5 core context");
  }
  auto context = std::make_unique<OsmesaContext>(handle);
  const ScopedCurrent current(*context);
  TESSERA_RETURN_IF_ERROR(current.status());
  TESSERA_RETURN_IF_ERROR(context->Describe());
  return std::unique_ptr<OffscreenContext>(std::move(context));
}

}  // namespace tessera
