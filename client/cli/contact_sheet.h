// Several pictures as one, in rows.
#pragma once

#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/image/image.h"

namespace tessera::cli {

// Linear RGB on a white ground, pictures in reading order, each centred in a cell of the largest size;
// `columns` 0 makes the sheet about square. Pictures with alpha are laid over the ground. `captions`, none or
// one a picture, stand below their cells, centred, in letters of 10 x 16 pixels (of 5 x 8 below cells
// narrower than 160), in as many lines as they need. Errors: INVALID_ARGUMENT when there is no picture, there
// are other than none or as many captions, or the sheet would be larger than 16384 pixels on a side.
[[nodiscard]] absl::StatusOr<Image> ContactSheet(const std::vector<Image>& pictures, int columns,
                                                 const std::vector<std::string>& captions = {});

}  // namespace tessera::cli
