// The service tessera.v1.Previews: a picture of a dressed surface.
#pragma once

#include <functional>
#include <memory>
#include <mutex>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/image/image.h"
#include "btf/render/offscreen_context.h"
#include "btf/wang/dressing.h"
#include "server/rpc/backend.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Pictures of up to this many pixels on a side.
inline constexpr uint32_t kMinPreviewSide = 16;
inline constexpr uint32_t kMaxPreviewSide = 4096;
inline constexpr int kMaxPreviewLights = 64;
// Codes and index of mip levels; on the way into the picture they take about twice as much again.
inline constexpr uint64_t kMaxPreviewMipBytes = uint64_t{512} << 20;

// False once the caller is gone.
using WritePreview = std::function<bool(const v1::RenderPreviewResponse&)>;

// Pictures are drawn one after the other in one offscreen context: the software renderer spreads each over
// every core by itself. Thread-safe.
class PreviewsService {
 public:
  explicit PreviewsService(const Backend& backend) : backend_(backend) {}

  // Writes progress while it draws, then the picture.
  [[nodiscard]] absl::Status RenderPreview(const v1::RenderPreviewRequest& request,
                                           const IsCancelled& is_cancelled, const WritePreview& write);

 private:
  [[nodiscard]] absl::StatusOr<std::string> Render(const v1::RenderPreviewRequest& request,
                                                   const RunContext& context);
  [[nodiscard]] absl::StatusOr<Dressing> SurfaceOf(const v1::RenderPreviewRequest& request,
                                                   const std::string& arrangement,
                                                   const RunContext& context) const;

  const Backend& backend_;
  std::timed_mutex context_mutex_;
  std::unique_ptr<OffscreenContext> context_;  // guarded by context_mutex_, made on first use
};

}  // namespace tessera
