#include "btf/remesh/triangle_mesh_io.h"

#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/remesh/binary_formats.h"
#include "btf/wang/mesh_io.h"
#include "btf/wang/mesh_text.h"

namespace tessera {
namespace {

TriangleMesh MeshOf(RawMesh raw, TriangleReadNotes& notes) {
  notes.faces_fanned = raw.faces_fanned;
  return {std::move(raw.positions), std::move(raw.triangles)};
}

absl::StatusOr<TriangleMesh> ParseFormat(std::span<const std::byte> bytes, std::string_view extension,
                                         const std::filesystem::path& folder, TriangleReadNotes& notes) {
  if (bytes.size() > kMaxMeshFileBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the file has ", bytes.size(), " bytes; the limit is ", kMaxMeshFileBytes));
  }
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (extension == ".obj" || extension == ".off") {
    TESSERA_ASSIGN_OR_RETURN(RawMesh raw, extension == ".obj" ? ParseObj(text, FaceKind::kPolygons)
                                                              : ParseOff(text, FaceKind::kPolygons));
    TESSERA_RETURN_IF_ERROR(raw.tally.Check());
    return MeshOf(std::move(raw), notes);
  }
  if (extension == ".ply") {
    return ParsePly(text, notes);
  }
  if (extension == ".gltf" || extension == ".glb") {
    return ParseGltf(text, folder, notes);
  }
  return absl::InvalidArgumentError("the extension is none of .obj, .off, .ply, .gltf and .glb");
}

absl::StatusOr<TriangleMesh> Parse(std::span<const std::byte> bytes, std::string_view file_name,
                                   const std::filesystem::path& folder, TriangleReadNotes& notes) {
  TESSERA_ASSIGN_OR_RETURN(TriangleMesh mesh, ParseFormat(bytes, MeshExtension(file_name), folder, notes));
  TESSERA_ASSIGN_OR_RETURN(notes.triangles_turned, OrientOutwards(mesh));
  return mesh;
}

}  // namespace

absl::StatusOr<TriangleMesh> ParseTriangleMesh(std::span<const std::byte> bytes, std::string_view file_name,
                                               const std::filesystem::path& folder,
                                               TriangleReadNotes* notes) {
  TriangleReadNotes own_notes;
  absl::StatusOr<TriangleMesh> mesh = Parse(bytes, file_name, folder, notes != nullptr ? *notes : own_notes);
  if (mesh.ok()) {
    return mesh;
  }
  const absl::string_view message = mesh.status().message();
  return absl::Status(mesh.status().code(), absl::StrCat(std::string(file_name), ": ",
                                                         std::string(message.data(), message.size())));
}

absl::StatusOr<TriangleMesh> ReadTriangleMesh(const std::filesystem::path& path, TriangleReadNotes* notes) {
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, ReadMeshFile(path));
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  return ParseTriangleMesh(std::as_bytes(std::span(bytes)), path.filename().string(), folder, notes);
}

}  // namespace tessera
