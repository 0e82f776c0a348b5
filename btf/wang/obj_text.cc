// Wavefront OBJ: https://paulbourke.net/dataformats/obj/ .
#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/wang/mesh_text.h"

namespace tessera {
namespace {

// The element that an OBJ index names among `count` listed so far: 1 is the first, -1 the last. Positive ones
// may run ahead; they are checked when everything is read.
absl::StatusOr<uint32_t> ElementOf(const LineReader& reader, std::string_view word, size_t count,
                                   std::string_view what) {
  TESSERA_ASSIGN_OR_RETURN(const int64_t index, ParseWhole(reader, word));
  const int64_t element = index < 0 ? static_cast<int64_t>(count) + index : index - 1;
  if (index == 0 || element < 0 || element >= static_cast<int64_t>(kMaxMeshVertices)) {
    return LineError(
        reader, absl::StrCat("the face names ", std::string(what), " ", index, ", which does not exist"));
  }
  return static_cast<uint32_t>(element);
}

absl::Status CheckRoom(const LineReader& reader, size_t count, size_t limit, std::string_view what) {
  if (count < limit) {
    return absl::OkStatus();
  }
  return absl::ResourceExhaustedError(
      absl::StrCat("line ", reader.line(), ": more than ", limit, " ", std::string(what)));
}

}  // namespace

absl::StatusOr<RawMesh> ParseObj(std::string_view text, FaceKind kind) {
  RawMesh mesh;
  mesh.tally = FaceTally(kind);
  std::vector<uint32_t> vertices;
  std::vector<int32_t> normals;
  bool any_normal = false;
  LineReader reader(text);
  while (reader.Next()) {
    const std::vector<std::string_view>& words = reader.words();
    if (words[0] == "v") {
      TESSERA_RETURN_IF_ERROR(CheckRoom(reader, mesh.positions.size(), kMaxMeshVertices, "vertices"));
      // x y z, with an optional weight and optional red, green and blue. Another number of numbers comes from
      // a damaged file, or from one whose lines end in a way that is not read here.
      if (const size_t numbers = words.size() - 1; numbers < 3 || numbers == 5 || numbers > 7) {
        return LineError(reader, absl::StrCat("a vertex of ", numbers, " numbers, expected 3"));
      }
      TESSERA_ASSIGN_OR_RETURN(const Eigen::Vector3f position, ParseVector(reader, 1));
      mesh.positions.push_back(position);
    } else if (words[0] == "vn") {
      TESSERA_RETURN_IF_ERROR(CheckRoom(reader, mesh.normals.size(), kMaxMeshVertices, "normals"));
      TESSERA_ASSIGN_OR_RETURN(const Eigen::Vector3f normal, ParseVector(reader, 1));
      mesh.normals.push_back(normal);
    } else if (words[0] == "f" && mesh.tally.Add(words.size() - 1, reader.line())) {
      const size_t corners = words.size() - 1;
      TESSERA_RETURN_IF_ERROR(CheckRoom(reader, mesh.quads.size(), kMaxMeshQuads, "quads"));
      TESSERA_RETURN_IF_ERROR(
          CheckRoom(reader, mesh.triangles.size() + corners - 3, kMaxMeshTriangles, "triangles"));
      vertices.assign(corners, 0);
      normals.assign(corners, -1);
      for (size_t corner = 0; corner < corners; ++corner) {
        // v, v/vt, v//vn or v/vt/vn.
        const std::string_view word = words[corner + 1];
        const size_t slash = word.find('/');
        TESSERA_ASSIGN_OR_RETURN(vertices[corner],
                                 ElementOf(reader, word.substr(0, slash), mesh.positions.size(), "vertex"));
        const size_t second = slash == std::string_view::npos ? slash : word.find('/', slash + 1);
        if (second != std::string_view::npos) {
          TESSERA_ASSIGN_OR_RETURN(const uint32_t normal,
                                   ElementOf(reader, word.substr(second + 1), mesh.normals.size(), "normal"));
          normals[corner] = static_cast<int32_t>(normal);
          any_normal = true;
        }
      }
      if (kind == FaceKind::kQuads) {
        mesh.quads.push_back({vertices[0], vertices[1], vertices[2], vertices[3]});
        mesh.corner_normals.push_back({normals[0], normals[1], normals[2], normals[3]});
      } else {
        mesh.AddFan(vertices);
      }
    }
  }
  if (!any_normal) {
    mesh.corner_normals.clear();
  }
  return mesh;
}

}  // namespace tessera
