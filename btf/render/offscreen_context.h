// A GL 4.5 core context without a window. Everything that renders takes one; OSMesa (llvmpipe, on the CPU) is
// the default.
//
//   TESSERA_ASSIGN_OR_RETURN(auto context, CreateOsmesaContext());
//   TESSERA_ASSIGN_OR_RETURN(Image image, RenderGl(*context, scene, run_context));
//
// A context belongs to one thread at a time: it may be used by several in turn (a call leaves it released),
// never by two at once. A server keeps one context a worker, or one behind a mutex. llvmpipe spreads the work
// of a context over every core by itself, so more contexts do not render faster. Compiled shaders stay with
// the context: the first picture of a codec's size costs their compilation, later ones do not.
#pragma once

#include <memory>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace tessera {

class GlState;

class OffscreenContext {
 public:
  using Procedure = void (*)();

  OffscreenContext();
  OffscreenContext(const OffscreenContext&) = delete;
  OffscreenContext& operator=(const OffscreenContext&) = delete;
  // The concrete destructor calls DestroyGlState() while the context can still be made current.
  virtual ~OffscreenContext();

  // Binds the context to the calling thread. Errors: INTERNAL when the driver refuses.
  [[nodiscard]] virtual absl::Status MakeCurrent() = 0;
  // Unbinds it, so that another thread may take it.
  virtual void Release() = 0;
  // Address of a GL function, nullptr when unknown. The context must be current.
  [[nodiscard]] virtual Procedure GetProcAddress(const char* name) const = 0;
  // "OSMesa, llvmpipe (LLVM 15.0.6, 256 bits), 4.5 (Core Profile) Mesa 22.3.6", for logs and reports.
  [[nodiscard]] virtual std::string Description() const = 0;

  // The function table and the compiled programs of this context, made on first use. The context must be
  // current. Errors: INTERNAL when a function of GL 4.5 is missing.
  [[nodiscard]] absl::StatusOr<GlState*> gl_state();

 protected:
  // Frees GL objects; the context must be current.
  void DestroyGlState();

 private:
  std::unique_ptr<GlState> gl_state_;
};

// Binds `context` to the calling thread for the lifetime of the object.
class ScopedCurrent {
 public:
  explicit ScopedCurrent(OffscreenContext& context) : context_(context), status_(context.MakeCurrent()) {}
  ScopedCurrent(const ScopedCurrent&) = delete;
  ScopedCurrent& operator=(const ScopedCurrent&) = delete;
  ~ScopedCurrent() {
    if (status_.ok()) {
      context_.Release();
    }
  }
  [[nodiscard]] const absl::Status& status() const { return status_; }

 private:
  OffscreenContext& context_;
  absl::Status status_;
};

// Mesa's software renderer. Errors: UNAVAILABLE when the library offers no 4.5 core context.
[[nodiscard]] absl::StatusOr<std::unique_ptr<OffscreenContext>> CreateOsmesaContext();

}  // namespace tessera
