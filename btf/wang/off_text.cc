// Geomview OFF: http://www.geomview.org/docs/html/OFF.html . ASCII, three dimensions; colours are passed
// over.
#include <algorithm>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/wang/mesh_text.h"

namespace tessera {
namespace {

struct OffHeader {
  bool has_normals = false;
  size_t num_vertices = 0;
  size_t num_faces = 0;
};

absl::StatusOr<OffHeader> ParseHeader(LineReader& reader) {
  OffHeader header;
  if (!reader.Next()) {
    return absl::InvalidArgumentError("the file is empty");
  }
  const std::string_view keyword = reader.words()[0];
  if (keyword != "OFF" && keyword != "COFF" && keyword != "NOFF" && keyword != "CNOFF") {
    return LineError(reader, "the file does not start with OFF, COFF, NOFF or CNOFF");
  }
  header.has_normals = keyword.find('N') != std::string_view::npos;
  size_t first = 1;  // counts may follow the keyword
  if (reader.words().size() == 1) {
    if (!reader.Next()) {
      return absl::InvalidArgumentError("the file ends before the counts");
    }
    first = 0;
  } else if (reader.words()[1] == "BINARY") {
    return LineError(reader, "binary OFF is not read; save it as ASCII");
  }
  if (reader.words().size() < first + 2) {
    return LineError(reader, "the counts of vertices and faces are missing");
  }
  const auto count = [&](size_t word, size_t limit, std::string_view what) -> absl::StatusOr<size_t> {
    TESSERA_ASSIGN_OR_RETURN(const int64_t value, ParseWhole(reader, reader.words()[word]));
    if (value < 0) {
      return LineError(reader, absl::StrCat(value, " ", std::string(what)));
    }
    if (static_cast<uint64_t>(value) > limit) {
      return absl::ResourceExhaustedError(absl::StrCat("line ", reader.line(), ": ", value, " ",
                                                       std::string(what), "; the limit is ", limit));
    }
    return static_cast<size_t>(value);
  };
  TESSERA_ASSIGN_OR_RETURN(header.num_vertices, count(first, kMaxMeshVertices, "vertices"));
  TESSERA_ASSIGN_OR_RETURN(header.num_faces, count(first + 1, kMaxMeshQuads, "faces"));
  return header;
}

}  // namespace

absl::StatusOr<RawMesh> ParseOff(std::string_view text, FaceKind kind) {
  LineReader reader(text);
  TESSERA_ASSIGN_OR_RETURN(const OffHeader header, ParseHeader(reader));
  RawMesh mesh;
  mesh.tally = FaceTally(kind);
  // Nothing is reserved by the counts: a short file may claim anything.
  for (size_t v = 0; v < header.num_vertices; ++v) {
    if (!reader.Next()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the file ends after ", v, " of ", header.num_vertices, " vertices"));
    }
    // Up to four numbers of colour may follow.
    if (const size_t most = header.has_normals ? 10 : 7; reader.words().size() > most) {
      return LineError(
          reader, absl::StrCat("a vertex of ", reader.words().size(), " numbers, expected at most ", most));
    }
    TESSERA_ASSIGN_OR_RETURN(const Eigen::Vector3f position, ParseVector(reader, 0));
    mesh.positions.push_back(position);
    if (header.has_normals) {
      TESSERA_ASSIGN_OR_RETURN(const Eigen::Vector3f normal, ParseVector(reader, 3));
      mesh.normals.push_back(normal);
    }
  }
  std::vector<uint32_t> vertices;
  for (size_t face = 0; face < header.num_faces; ++face) {
    if (!reader.Next()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the file ends after ", face, " of ", header.num_faces, " faces"));
    }
    TESSERA_ASSIGN_OR_RETURN(const int64_t corners, ParseWhole(reader, reader.words()[0]));
    if (corners < 0 || static_cast<uint64_t>(corners) > reader.words().size() - 1) {
      return LineError(reader, absl::StrCat("face ", face + 1, " claims ", corners, " corners and lists ",
                                            reader.words().size() - 1));
    }
    if (!mesh.tally.Add(static_cast<size_t>(corners), reader.line())) {
      continue;
    }
    vertices.assign(static_cast<size_t>(corners), 0);
    for (size_t corner = 0; corner < vertices.size(); ++corner) {
      TESSERA_ASSIGN_OR_RETURN(const int64_t vertex, ParseWhole(reader, reader.words()[corner + 1]));
      if (vertex < 0 || static_cast<uint64_t>(vertex) >= header.num_vertices) {
        return LineError(reader, absl::StrCat("face ", face + 1, " names vertex ", vertex, ", expected 0 to ",
                                              static_cast<int64_t>(header.num_vertices) - 1));
      }
      vertices[corner] = static_cast<uint32_t>(vertex);
    }
    if (kind == FaceKind::kQuads) {
      mesh.quads.push_back({vertices[0], vertices[1], vertices[2], vertices[3]});
      continue;
    }
    if (mesh.triangles.size() + vertices.size() - 2 > kMaxMeshTriangles) {
      return absl::ResourceExhaustedError(
          absl::StrCat("line ", reader.line(), ": more than ", kMaxMeshTriangles, " triangles"));
    }
    mesh.AddFan(vertices);
  }
  if (header.has_normals) {
    mesh.corner_normals.resize(mesh.quads.size());
    for (size_t face = 0; face < mesh.quads.size(); ++face) {
      std::transform(mesh.quads[face].begin(), mesh.quads[face].end(), mesh.corner_normals[face].begin(),
                     [](uint32_t vertex) { return static_cast<int32_t>(vertex); });
    }
  }
  return mesh;
}

}  // namespace tessera
