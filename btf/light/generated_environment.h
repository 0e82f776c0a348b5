// Environments without a file, for charts and tests.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/light/environment.h"

namespace tessera {

// "sky": a haze that nothing in it outshines; "studio": four lamps a hundred times as bright as the dark room
// around them; "sun": one texel, of half the power, above a dim sky. 64 x 32 texels, equirectangular, mean
// radiance about 1.
[[nodiscard]] std::vector<std::string> GeneratedEnvironmentNames();
// Errors: INVALID_ARGUMENT naming the name and the legal ones.
[[nodiscard]] absl::StatusOr<Environment> GeneratedEnvironment(std::string_view name);

}  // namespace tessera
