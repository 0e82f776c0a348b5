// Reads quad meshes from Wavefront OBJ and Geomview OFF, and writes OBJ.
//
//   TESSERA_ASSIGN_OR_RETURN(QuadMesh mesh, ReadQuadMesh("horse_quad.obj"));
//
// Both formats list a face's vertices counter-clockwise seen from the front. Read here: OBJ `v`, `vn` and `f`
// (v, v/vt, v//vn, v/vt/vn, negative indices, '\' continuations); every other OBJ statement is passed over.
// OFF and COFF, NOFF, CNOFF in ASCII; colours are passed over. Numbers are parsed strictly: what is not a
// finite number is an error and never a silent 0, which is why tinyobjloader is not used (2.0.0rc10 reads
// "nan" as 0, a cut-off vertex as one with zeros, and drops faces of two vertices, which shifts the numbers
// of all later ones).
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include <absl/status/statusor.h>

#include "btf/wang/quad_mesh.h"

namespace tessera {

// Most bytes a mesh file may have; kMaxMeshQuads and kMaxMeshVertices bound what is in it.
inline constexpr size_t kMaxMeshFileBytes = size_t{1} << 30;

// What reading changed, for people.
struct MeshReadNotes {
  size_t faces_turned = 0;      // wound against the majority of their component
  size_t vertices_split = 0;    // where faces met in a point only
  size_t vertices_dropped = 0;  // referenced by no face
  size_t faces_not_quads = 0;   // when above 0, this is why the mesh was refused
};

// The mesh in `bytes`; the format is told by the extension of `file_name`, which also opens every message.
// Faces wound against the majority of their connected component are turned (OrientFaces), a vertex in which
// faces meet without sharing an edge is doubled (SplitSingularVertices), and unreferenced vertices are
// dropped. Normals are the file's, averaged over the corners that meet in a vertex; corners whose normal
// points behind their face are passed over, and vertices left without any get ComputeNormals'. Errors:
// INVALID_ARGUMENT naming the line (malformed or non-finite number, wrong count, cut-off file), the face
// (triangle, n-gon, missing vertex, repeated vertex) or the edge (not a manifold, not orientable), or an
// unknown extension; RESOURCE_EXHAUSTED naming the size and the limit.
[[nodiscard]] absl::StatusOr<QuadMesh> ParseQuadMesh(std::span<const std::byte> bytes,
                                                     std::string_view file_name,
                                                     MeshReadNotes* notes = nullptr);

// ParseQuadMesh of a file. Errors: also NOT_FOUND, PERMISSION_DENIED and INTERNAL naming the path.
[[nodiscard]] absl::StatusOr<QuadMesh> ReadQuadMesh(const std::filesystem::path& path,
                                                    MeshReadNotes* notes = nullptr);

// The mesh as text of an OBJ file: positions, normals, quads; numbers read back as the same float32.
[[nodiscard]] std::string WriteObj(const QuadMesh& mesh);

// The bytes of a file of at most kMaxMeshFileBytes. Errors: NOT_FOUND, INVALID_ARGUMENT (not a file),
// RESOURCE_EXHAUSTED naming size and limit, PERMISSION_DENIED and INTERNAL naming the path.
[[nodiscard]] absl::StatusOr<std::string> ReadMeshFile(const std::filesystem::path& path);

// The extension of a file name, ".obj" for "Horse.OBJ"; empty without one.
[[nodiscard]] std::string MeshExtension(std::string_view file_name);

}  // namespace tessera
