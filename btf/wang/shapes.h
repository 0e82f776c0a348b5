// Built-in quad meshes, about unit radius, y up, ready to be dressed with tiles of 64 texels.
//
//   plane       1 x 1 x 0, 16 x 16 quads, facing +z
//   torus       radii 0.7 and 0.3 about the y axis, 32 x 14 quads (not subdivided further)
//   cube-sphere a cube's 6 x 8 x 8 quads on the unit sphere
//   genus3      a rounded block with three round holes
//
// `plane` and `torus` carry one consistent frame, so `plane-16` dresses them without breaks.
#pragma once

#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/wang/quad_mesh.h"

namespace tessera {

// Closed (but for plane), oriented, with unit normals. Errors: NOT_FOUND naming the shape and the known ones.
[[nodiscard]] absl::StatusOr<QuadMesh> BuiltinShape(std::string_view name);

// In alphabetical order.
[[nodiscard]] const std::vector<std::string_view>& BuiltinShapeNames();

}  // namespace tessera
