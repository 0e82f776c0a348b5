// tessera material mask, and recipe files as commands read them.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <CLI/App.hpp>

#include "btf/image/image.h"
#include "btf/tiles/recipe.h"
#include "client/cli/session.h"

namespace tessera::cli {

// Errors: those of reading the file, and ParseRecipe's, led by the path.
[[nodiscard]] absl::StatusOr<Recipe> ReadRecipeFile(const std::string& path);

// `picture`, linear RGB, with the texels of `mask` [height][width] that are 1 in red by half and the others
// darker.
[[nodiscard]] Image Highlighted(const Image& picture, const std::vector<uint8_t>& mask);

void AddMaskCommand(CLI::App& noun, Session& session);

}  // namespace tessera::cli
