// The environment of a preview: its lights, or its part in the frequency domain.
#pragma once

#include <optional>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/light/frequency_light.h"
#include "btf/render/preview.h"
#include "server/rpc/backend.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

inline constexpr uint64_t kMaxEnvironmentBytes = uint64_t{256} << 20;
inline constexpr uint32_t kMaxEnvironmentLights = 1000;
inline constexpr uint32_t kMaxEnvironmentOrder = 7;

struct PreviewEnvironment {
  std::vector<Light> lights;
  std::optional<FrequencyLight> frequency_light;
};

// Nothing where the request has none. An orbit that turns lights turns it, too. Errors: INVALID_ARGUMENT
// naming `environment`, the value and the limit, or what is wrong with the picture; NOT_FOUND (no such blob).
[[nodiscard]] absl::StatusOr<PreviewEnvironment> EnvironmentOf(const Backend& backend,
                                                               const v1::RenderPreviewRequest& request);

}  // namespace tessera
