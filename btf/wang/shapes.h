// Built-in quad meshes, about unit radius, y up, z towards the viewer, with quads of about 0.13 on a side.
//
//   plane        [-1, 1] x [-1, 1] x 0, 16 x 16 quads, facing +z
//   torus        radii 0.7 and 0.3 about the y axis, 32 x 14 quads
//   cube-sphere  6 x 10 x 10 quads on the unit sphere, at equal angles
//   genus3       a smooth solid with three holes, three-fold symmetric about the z axis, 528 quads
//
// `plane` and `torus` carry one consistent frame, so `plane-16` dresses them without breaks.
#pragma once

#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/wang/quad_mesh.h"

namespace tessera {

// Closed (but for plane) and oriented, with unit normals. Errors: NOT_FOUND naming the shape and the known
// ones.
[[nodiscard]] absl::StatusOr<QuadMesh> BuiltinShape(std::string_view name);

// In alphabetical order.
[[nodiscard]] const std::vector<std::string_view>& BuiltinShapeNames();

}  // namespace tessera
