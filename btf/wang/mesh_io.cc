#include "btf/wang/mesh_io.h"

#include <algorithm>
#include <string>
#include <system_error>

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <Eigen/Geometry>

#include "btf/base/atomic_file.h"
#include "btf/base/file_error.h"
#include "btf/base/status_macros.h"
#include "btf/wang/mesh_text.h"
#include "btf/wang/mesh_topology.h"

namespace tessera {
namespace {

absl::Status CheckCornerNormals(const RawMesh& raw) {
  for (size_t face = 0; face < raw.corner_normals.size(); ++face) {
    for (const int32_t normal : raw.corner_normals[face]) {
      if (normal >= static_cast<int64_t>(raw.normals.size())) {
        return absl::InvalidArgumentError(absl::StrCat("face ", face + 1, ": normal ", normal + 1,
                                                       " does not exist; the mesh has ", raw.normals.size()));
      }
    }
  }
  return absl::OkStatus();
}

// Vertex normals from the file's corner normals where these face the same way as the surface.
void TakeNormals(const RawMesh& raw, QuadMesh& mesh) {
  mesh.normals = ComputeNormals(mesh);
  if (raw.corner_normals.empty()) {
    return;
  }
  std::vector<Eigen::Vector3d> sums(mesh.positions.size(), Eigen::Vector3d::Zero());
  for (size_t face = 0; face < mesh.quads.size(); ++face) {
    for (int corner = 0; corner < 4; ++corner) {
      const int32_t index = raw.corner_normals[face][corner];
      const Eigen::Vector3d surface = WeightedCornerNormal(mesh, face, corner);
      if (index < 0) {
        continue;
      }
      const Eigen::Vector3d normal = raw.normals[index].cast<double>();
      if (normal.dot(surface) > 0.0) {
        sums[mesh.quads[face][corner]] += surface.norm() * normal.normalized();
      }
    }
  }
  for (size_t v = 0; v < sums.size(); ++v) {
    if (const double length = sums[v].norm(); length > 0.0) {
      mesh.normals[v] = (sums[v] / length).cast<float>();
    }
  }
}

absl::StatusOr<QuadMesh> Finish(RawMesh raw, MeshReadNotes& notes) {
  QuadMesh mesh;
  mesh.positions = std::move(raw.positions);
  mesh.quads = std::move(raw.quads);
  // Stand-ins, so that everything else can be checked before normals are computed from it.
  mesh.normals.assign(mesh.positions.size(), Eigen::Vector3f::UnitZ());
  TESSERA_RETURN_IF_ERROR(ValidateQuadMesh(mesh));
  TESSERA_RETURN_IF_ERROR(CheckCornerNormals(raw));

  const std::vector<Quad> as_listed = mesh.quads;
  TESSERA_ASSIGN_OR_RETURN(notes.faces_turned, OrientFaces(mesh));
  for (size_t face = 0; face < raw.corner_normals.size(); ++face) {
    if (mesh.quads[face] != as_listed[face]) {
      std::swap(raw.corner_normals[face][1], raw.corner_normals[face][3]);
    }
  }
  TESSERA_ASSIGN_OR_RETURN(const QuadAdjacency adjacency, BuildAdjacency(mesh));
  notes.vertices_split = SplitSingularVertices(mesh, adjacency);
  TakeNormals(raw, mesh);
  notes.vertices_dropped = DropUnreferencedVertices(mesh);
  return mesh;
}

absl::StatusOr<QuadMesh> Parse(std::span<const std::byte> bytes, std::string_view file_name,
                               MeshReadNotes& notes) {
  if (bytes.size() > kMaxMeshFileBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the file has ", bytes.size(), " bytes; the limit is ", kMaxMeshFileBytes));
  }
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::string extension = MeshExtension(file_name);
  if (extension != ".obj" && extension != ".off") {
    return absl::InvalidArgumentError("the extension is neither .obj nor .off");
  }
  TESSERA_ASSIGN_OR_RETURN(
      RawMesh raw, extension == ".obj" ? ParseObj(text, FaceKind::kQuads) : ParseOff(text, FaceKind::kQuads));
  notes.faces_not_quads = raw.tally.others();
  TESSERA_RETURN_IF_ERROR(raw.tally.Check());
  return Finish(std::move(raw), notes);
}

absl::Status Named(const absl::Status& status, std::string_view name) {
  return absl::Status(
      status.code(),
      absl::StrCat(std::string(name), ": ", std::string(status.message().data(), status.message().size())));
}

}  // namespace

absl::StatusOr<QuadMesh> ParseQuadMesh(std::span<const std::byte> bytes, std::string_view file_name,
                                       MeshReadNotes* notes) {
  MeshReadNotes own_notes;
  absl::StatusOr<QuadMesh> mesh = Parse(bytes, file_name, notes != nullptr ? *notes : own_notes);
  return mesh.ok() ? std::move(mesh) : Named(mesh.status(), file_name);
}

absl::StatusOr<QuadMesh> ReadQuadMesh(const std::filesystem::path& path, MeshReadNotes* notes) {
  TESSERA_ASSIGN_OR_RETURN(const std::string text, ReadMeshFile(path));
  return ParseQuadMesh(std::as_bytes(std::span(text)), path.filename().string(), notes);
}

std::string WriteObj(const QuadMesh& mesh) {
  std::string text;
  for (const Eigen::Vector3f& p : mesh.positions) {
    absl::StrAppendFormat(&text, "v %.9g %.9g %.9g\n", p.x(), p.y(), p.z());
  }
  for (const Eigen::Vector3f& n : mesh.normals) {
    absl::StrAppendFormat(&text, "vn %.9g %.9g %.9g\n", n.x(), n.y(), n.z());
  }
  for (const Quad& quad : mesh.quads) {
    absl::StrAppend(&text, "f");
    for (const uint32_t vertex : quad) {
      absl::StrAppend(&text, " ", uint64_t{vertex} + 1, "//", uint64_t{vertex} + 1);
    }
    absl::StrAppend(&text, "\n");
  }
  return text;
}

absl::StatusOr<std::string> ReadMeshFile(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::NotFoundError(absl::StrCat(path.string(), ": there is no such file"));
  }
  if (!std::filesystem::is_regular_file(status)) {
    return absl::InvalidArgumentError(absl::StrCat(path.string(), ": not a file"));
  }
  const uintmax_t size = std::filesystem::file_size(path, error);
  if (error) {
    return FileError(error.value(), "cannot read", path);
  }
  if (size > kMaxMeshFileBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat(path.string(), ": the file has ", size, " bytes; the limit is ", kMaxMeshFileBytes));
  }
  return ReadWholeFile(path);
}

std::string MeshExtension(std::string_view file_name) {
  const size_t dot = file_name.rfind('.');
  return dot == std::string_view::npos ? "" : absl::AsciiStrToLower(std::string(file_name.substr(dot)));
}

}  // namespace tessera
