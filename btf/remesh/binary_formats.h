// The two formats of triangle_mesh_io.h that are not text alone.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>

#include <absl/status/statusor.h>

#include "btf/remesh/triangle_mesh.h"
#include "btf/remesh/triangle_mesh_io.h"

namespace tessera {

// PLY, http://paulbourke.net/dataformats/ply/ . Errors: INVALID_ARGUMENT naming the header's line or the
// element, RESOURCE_EXHAUSTED naming count and limit. Nothing is reserved by counts.
[[nodiscard]] absl::StatusOr<TriangleMesh> ParsePly(std::string_view bytes, TriangleReadNotes& notes);

// glTF 2.0, https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html , as JSON or, when the bytes start with
// its magic number, as GLB. Vertices at one place are merged, triangles that lose a side by it are left out.
// Errors: INVALID_ARGUMENT naming the object ("accessor 3: ..."), RESOURCE_EXHAUSTED naming count and limit;
// those of reading a buffer file in `folder`.
[[nodiscard]] absl::StatusOr<TriangleMesh> ParseGltf(std::string_view bytes,
                                                     const std::filesystem::path& folder,
                                                     TriangleReadNotes& notes);

}  // namespace tessera
