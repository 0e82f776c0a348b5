// Several pictures as one, in rows.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

#include "btf/image/image.h"

namespace tessera::cli {

// Linear RGB on a white ground, pictures in reading order, each centred in a cell of the largest size;
// `columns` 0 makes the sheet about square. Pictures with alpha are laid over the ground. Errors:
// INVALID_ARGUMENT when there is no picture or the sheet would be larger than 16384 pixels on a side.
[[nodiscard]] absl::StatusOr<Image> ContactSheet(const std::vector<Image>& pictures, int columns);

}  // namespace tessera::cli
