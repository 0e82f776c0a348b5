// Reads closed triangle surfaces from OBJ, OFF, PLY and glTF.
//
//   TESSERA_ASSIGN_OR_RETURN(TriangleMesh mesh, ReadTriangleMesh("bunny.ply"));
//
// OBJ and OFF as in btf/wang/mesh_io.h. PLY in ASCII and binary little-endian: x, y, z of `vertex` and the
// list `vertex_indices` or `vertex_index` of `face`; other elements and properties are passed over. glTF 2.0
// as .glb, or .gltf with embedded buffers or files beside it: the triangles of every mesh of the scene,
// placed by their nodes; no extensions, no sparse accessors, no skins. Faces of more than three corners
// become fans about their first corner.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>

#include <absl/status/statusor.h>

#include "btf/remesh/triangle_mesh.h"

namespace tessera {

// What reading changed, for people.
struct TriangleReadNotes {
  size_t triangles_turned = 0;  // wound against the outward side
  size_t faces_fanned = 0;      // faces of more than three corners that became triangles
  size_t vertices_merged = 0;   // at one place; glTF doubles vertices along seams
};

// The mesh in `bytes`; the format is told by the extension of `file_name`, which also opens every message.
// Triangles are turned outwards (OrientOutwards). `folder` is where buffer files of a .gltf are; empty: there
// are none. Errors: INVALID_ARGUMENT naming the line, the element or the edge (malformed or non-finite
// number, index out of range, cut-off file, not closed, not a manifold, not orientable), or an unknown
// extension; RESOURCE_EXHAUSTED naming the size and the limit (kMaxMeshFileBytes, kMaxMeshVertices,
// kMaxMeshTriangles); those of reading a buffer file.
[[nodiscard]] absl::StatusOr<TriangleMesh> ParseTriangleMesh(std::span<const std::byte> bytes,
                                                             std::string_view file_name,
                                                             const std::filesystem::path& folder,
                                                             TriangleReadNotes* notes = nullptr);

// ParseTriangleMesh of a file. Errors: also those of ReadMeshFile.
[[nodiscard]] absl::StatusOr<TriangleMesh> ReadTriangleMesh(const std::filesystem::path& path,
                                                            TriangleReadNotes* notes = nullptr);

}  // namespace tessera
