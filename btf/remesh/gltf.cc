#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "btf/base/status_macros.h"
#include "btf/remesh/binary_formats.h"
#include "btf/wang/mesh_io.h"

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF buffers are read as they lie in memory");

using GltfJson = nlohmann::json;

constexpr uint32_t kGlbMagic = 0x46546C67;      // "glTF"
constexpr uint32_t kGlbJsonChunk = 0x4E4F534A;  // "JSON"
constexpr uint32_t kGlbBinChunk = 0x004E4942;   // "BIN"
constexpr size_t kMaxJsonBytes = size_t{1} << 26;
constexpr uint64_t kModeTriangles = 4;

absl::Status GltfError(std::string_view what, uint64_t index, std::string_view message) {
  return absl::InvalidArgumentError(absl::StrCat(std::string(what), " ", index, ": ", std::string(message)));
}

// The whole number `key` of an object; `otherwise` when it is not there.
absl::StatusOr<uint64_t> Whole(const GltfJson& object, const char* key, std::optional<uint64_t> otherwise) {
  if (object.is_object()) {
    const auto found = object.find(key);
    if (found == object.end() && otherwise) {
      return *otherwise;
    }
    if (found != object.end() && found->is_number_unsigned()) {
      return found->get<uint64_t>();
    }
  }
  return absl::InvalidArgumentError(absl::StrCat("'", key, "' is missing or not a whole number"));
}

// Element `index` of the top-level list `key`.
absl::StatusOr<const GltfJson*> Element(const GltfJson& root, const char* key, uint64_t index) {
  const auto list = root.find(key);
  const size_t size = list != root.end() && list->is_array() ? list->size() : 0;
  if (index >= size || !(*list)[index].is_object()) {
    return absl::InvalidArgumentError(
        absl::StrCat("element ", index, " of '", key, "' does not exist; the file has ", size));
  }
  return &(*list)[index];
}

// `count` finite numbers of the list `key`, or none when it is not there.
absl::StatusOr<std::vector<double>> Numbers(const GltfJson& object, const char* key, size_t count) {
  std::vector<double> numbers;
  const auto list = object.find(key);
  if (list == object.end()) {
    return numbers;
  }
  if (list->is_array() && list->size() == count) {
    for (const GltfJson& value : *list) {
      if (value.is_number() && std::isfinite(value.get<double>())) {
        numbers.push_back(value.get<double>());
      }
    }
  }
  if (numbers.size() != count) {
    return absl::InvalidArgumentError(absl::StrCat("'", key, "' is not a list of ", count, " numbers"));
  }
  return numbers;
}

// target_from_source of one node.
absl::StatusOr<Eigen::Affine3d> TransformOf(const GltfJson& node) {
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  TESSERA_ASSIGN_OR_RETURN(const std::vector<double> matrix, Numbers(node, "matrix", 16));
  if (!matrix.empty()) {
    transform.matrix() = Eigen::Map<const Eigen::Matrix4d>(matrix.data());  // both column-major
    return transform;
  }
  TESSERA_ASSIGN_OR_RETURN(const std::vector<double> move, Numbers(node, "translation", 3));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<double> turn, Numbers(node, "rotation", 4));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<double> scale, Numbers(node, "scale", 3));
  if (!move.empty()) {
    transform.translate(Eigen::Vector3d(move[0], move[1], move[2]));
  }
  if (!turn.empty()) {
    transform.rotate(Eigen::Quaterniond(turn[3], turn[0], turn[1], turn[2]).normalized());
  }
  if (!scale.empty()) {
    transform.scale(Eigen::Vector3d(scale[0], scale[1], scale[2]));
  }
  return transform;
}

class GltfReader {
 public:
  GltfReader(GltfJson root, std::optional<std::string_view> binary, const std::filesystem::path& folder)
      : root_(std::move(root)), binary_(binary), folder_(folder) {}

  absl::StatusOr<TriangleMesh> Read();

 private:
  // Numbers of an accessor in the file's bytes.
  struct View {
    std::string_view bytes;
    uint64_t count = 0;
    uint64_t stride = 0;
    uint64_t component = 0;  // GL's name of the type
  };

  absl::StatusOr<std::string_view> Buffer(uint64_t index);
  absl::StatusOr<View> Accessor(uint64_t index, std::string_view type);
  absl::Status AddPrimitive(const GltfJson& primitive, const Eigen::Affine3d& place);
  absl::Status AddMesh(uint64_t index, const Eigen::Affine3d& place);
  absl::Status AddNodes(const GltfJson& scene);

  GltfJson root_;
  std::optional<std::string_view> binary_;
  const std::filesystem::path& folder_;
  std::vector<std::optional<std::string>> buffers_;  // those from files and URIs, by index
  TriangleMesh mesh_;
};

absl::StatusOr<std::string_view> GltfReader::Buffer(uint64_t index) {
  TESSERA_ASSIGN_OR_RETURN(const GltfJson* buffer, Element(root_, "buffers", index));
  TESSERA_ASSIGN_OR_RETURN(const uint64_t length, Whole(*buffer, "byteLength", std::nullopt));
  const auto uri = buffer->find("uri");
  std::string_view bytes;
  if (uri == buffer->end()) {
    if (index != 0 || !binary_) {
      return GltfError("buffer", index, "it has no URI and the file no binary chunk");
    }
    bytes = *binary_;
  } else {
    if (!uri->is_string()) {
      return GltfError("buffer", index, "the URI is not text");
    }
    buffers_.resize(std::max<size_t>(buffers_.size(), index + 1));
    std::optional<std::string>& stored = buffers_[index];
    const auto& text = uri->get_ref<const std::string&>();
    constexpr std::string_view kBase64 = ";base64,";
    if (const size_t comma = text.find(kBase64); !stored && text.starts_with("data:")) {
      std::string decoded;
      if (comma == std::string::npos ||
          !absl::Base64Unescape(text.substr(comma + kBase64.size()), &decoded)) {
        return GltfError("buffer", index, "the data of the URI is not base64");
      }
      stored = std::move(decoded);
    } else if (!stored) {
      // A plain name, so that a file from elsewhere reads nothing but what lies beside it.
      if (text.empty() || text.find_first_of("/\\:%") != std::string::npos || text.starts_with('.') ||
          folder_.empty()) {
        return GltfError("buffer", index, "the URI is not the plain name of a file beside this one");
      }
      TESSERA_ASSIGN_OR_RETURN(stored, ReadMeshFile(folder_ / text));
    }
    bytes = *stored;
  }
  if (length > bytes.size()) {
    return GltfError("buffer", index, absl::StrCat(length, " bytes named, ", bytes.size(), " found"));
  }
  return bytes.substr(0, length);
}

absl::StatusOr<GltfReader::View> GltfReader::Accessor(uint64_t index, std::string_view type) {
  TESSERA_ASSIGN_OR_RETURN(const GltfJson* accessor, Element(root_, "accessors", index));
  if (accessor->contains("sparse") || !accessor->contains("bufferView")) {
    return GltfError("accessor", index, "sparse or compressed numbers are not read");
  }
  const auto named = accessor->find("type");
  if (named == accessor->end() || *named != std::string(type)) {
    return GltfError("accessor", index, absl::StrCat("the type is not ", std::string(type)));
  }
  View view;
  TESSERA_ASSIGN_OR_RETURN(const uint64_t view_index, Whole(*accessor, "bufferView", std::nullopt));
  TESSERA_ASSIGN_OR_RETURN(view.count, Whole(*accessor, "count", std::nullopt));
  TESSERA_ASSIGN_OR_RETURN(view.component, Whole(*accessor, "componentType", std::nullopt));
  TESSERA_ASSIGN_OR_RETURN(const uint64_t offset, Whole(*accessor, "byteOffset", 0));
  if (view.count > kMaxMeshVertices) {
    return absl::ResourceExhaustedError(
        absl::StrCat("accessor ", index, ": ", view.count, " elements; the limit is ", kMaxMeshVertices));
  }
  uint64_t size = 0;
  if (type == "VEC3" && view.component == 5126) {
    size = 3 * sizeof(float);
  } else if (type == "SCALAR" && view.component == 5121) {
    size = 1;
  } else if (type == "SCALAR" && view.component == 5123) {
    size = 2;
  } else if (type == "SCALAR" && view.component == 5125) {
    size = 4;
  } else {
    return GltfError("accessor", index, absl::StrCat("component type ", view.component, " is not read here"));
  }
  TESSERA_ASSIGN_OR_RETURN(const GltfJson* buffer_view, Element(root_, "bufferViews", view_index));
  TESSERA_ASSIGN_OR_RETURN(const uint64_t buffer_index, Whole(*buffer_view, "buffer", std::nullopt));
  TESSERA_ASSIGN_OR_RETURN(const uint64_t begin, Whole(*buffer_view, "byteOffset", 0));
  TESSERA_ASSIGN_OR_RETURN(const uint64_t length, Whole(*buffer_view, "byteLength", std::nullopt));
  TESSERA_ASSIGN_OR_RETURN(view.stride, Whole(*buffer_view, "byteStride", size));
  TESSERA_ASSIGN_OR_RETURN(const std::string_view buffer, Buffer(buffer_index));
  if (begin > buffer.size() || length > buffer.size() - begin) {
    return GltfError("buffer view", view_index,
                     absl::StrCat("it ends beyond the ", buffer.size(), " bytes of buffer ", buffer_index));
  }
  constexpr uint64_t kMaxStride = 252;  // glTF 2.0, 5.11.4
  if (view.stride < size || view.stride > kMaxStride) {
    return GltfError("buffer view", view_index, absl::StrCat("a stride of ", view.stride, " bytes"));
  }
  if (offset > length || (view.count > 0 && (view.count - 1) * view.stride + size > length - offset)) {
    return GltfError(
        "accessor", index,
        absl::StrCat(view.count, " elements end beyond the ", length, " bytes of buffer view ", view_index));
  }
  view.bytes = buffer.substr(begin + offset, length - offset);
  return view;
}

absl::Status GltfReader::AddPrimitive(const GltfJson& primitive, const Eigen::Affine3d& place) {
  TESSERA_ASSIGN_OR_RETURN(const uint64_t mode, Whole(primitive, "mode", kModeTriangles));
  if (mode != kModeTriangles) {
    return absl::InvalidArgumentError(
        absl::StrCat("a primitive of mode ", mode, "; only triangles (", kModeTriangles, ") are read"));
  }
  const auto attributes = primitive.find("attributes");
  if (attributes == primitive.end()) {
    return absl::InvalidArgumentError("a primitive has no attributes");
  }
  TESSERA_ASSIGN_OR_RETURN(const uint64_t position_index, Whole(*attributes, "POSITION", std::nullopt));
  TESSERA_ASSIGN_OR_RETURN(const View positions, Accessor(position_index, "VEC3"));
  const size_t base = mesh_.positions.size();
  if (base + positions.count > kMaxMeshVertices) {
    return absl::ResourceExhaustedError(absl::StrCat("more than ", kMaxMeshVertices, " vertices"));
  }
  for (uint64_t i = 0; i < positions.count; ++i) {
    Eigen::Vector3f p;
    std::memcpy(p.data(), positions.bytes.data() + i * positions.stride, 3 * sizeof(float));
    // The sum makes -0 the same place as 0.
    mesh_.positions.emplace_back((place * p.cast<double>()).cast<float>() + Eigen::Vector3f::Zero());
    if (!mesh_.positions.back().allFinite()) {
      return GltfError("accessor", position_index, absl::StrCat("position ", i, " is not finite"));
    }
  }
  uint64_t num_corners = positions.count;
  std::optional<View> indices;
  if (primitive.contains("indices")) {
    TESSERA_ASSIGN_OR_RETURN(const uint64_t index, Whole(primitive, "indices", std::nullopt));
    TESSERA_ASSIGN_OR_RETURN(indices, Accessor(index, "SCALAR"));
    num_corners = indices->count;
  }
  if (num_corners % 3 != 0) {
    return absl::InvalidArgumentError(absl::StrCat("triangles of ", num_corners, " corners in all"));
  }
  if (mesh_.triangles.size() + num_corners / 3 > kMaxMeshTriangles) {
    return absl::ResourceExhaustedError(absl::StrCat("more than ", kMaxMeshTriangles, " triangles"));
  }
  // Mirrored parts keep their outside.
  const bool mirrored = place.linear().determinant() < 0.0;
  Triangle triangle{};
  for (uint64_t i = 0; i < num_corners; ++i) {
    auto vertex = static_cast<uint32_t>(i);
    if (indices) {
      vertex = 0;
      const size_t size = indices->component == 5121 ? 1 : indices->component == 5123 ? 2 : 4;
      std::memcpy(&vertex, indices->bytes.data() + i * indices->stride, size);
    }
    if (vertex >= positions.count) {
      return absl::InvalidArgumentError(absl::StrCat("index ", i, " names vertex ", vertex,
                                                     ", which does not exist; accessor ", position_index,
                                                     " has ", positions.count));
    }
    triangle[i % 3] = static_cast<uint32_t>(base + vertex);
    if (i % 3 == 2) {
      if (mirrored) {
        std::swap(triangle[1], triangle[2]);
      }
      mesh_.triangles.push_back(triangle);
    }
  }
  return absl::OkStatus();
}

absl::Status GltfReader::AddMesh(uint64_t index, const Eigen::Affine3d& place) {
  TESSERA_ASSIGN_OR_RETURN(const GltfJson* mesh, Element(root_, "meshes", index));
  const auto primitives = mesh->find("primitives");
  if (primitives == mesh->end() || !primitives->is_array()) {
    return GltfError("mesh", index, "it has no primitives");
  }
  for (const GltfJson& primitive : *primitives) {
    if (const absl::Status status = AddPrimitive(primitive, place); !status.ok()) {
      return absl::Status(
          status.code(),
          absl::StrCat("mesh ", index, ": ", std::string(status.message().data(), status.message().size())));
    }
  }
  return absl::OkStatus();
}

absl::Status GltfReader::AddNodes(const GltfJson& scene) {
  struct Pending {
    uint64_t node = 0;
    Eigen::Affine3d place = Eigen::Affine3d::Identity();
  };
  std::vector<Pending> pending;
  const auto push = [&](const GltfJson& object, const char* key, const Eigen::Affine3d& place) {
    const auto list = object.find(key);
    if (list == object.end()) {
      return absl::OkStatus();
    }
    for (const GltfJson& index : *list) {
      if (!index.is_number_unsigned()) {
        return absl::InvalidArgumentError(absl::StrCat("'", key, "' is not a list of whole numbers"));
      }
      pending.push_back({index.get<uint64_t>(), place});
    }
    return absl::OkStatus();
  };
  TESSERA_RETURN_IF_ERROR(push(scene, "nodes", Eigen::Affine3d::Identity()));
  std::vector<bool> visited;
  while (!pending.empty()) {
    const Pending next = pending.back();
    pending.pop_back();
    TESSERA_ASSIGN_OR_RETURN(const GltfJson* node, Element(root_, "nodes", next.node));
    visited.resize(root_["nodes"].size(), false);
    if (visited[next.node]) {
      return GltfError("node", next.node, "it occurs twice in the scene");
    }
    visited[next.node] = true;
    TESSERA_ASSIGN_OR_RETURN(const Eigen::Affine3d own, TransformOf(*node));
    const Eigen::Affine3d place = next.place * own;
    if (node->contains("mesh")) {
      TESSERA_ASSIGN_OR_RETURN(const uint64_t mesh, Whole(*node, "mesh", std::nullopt));
      TESSERA_RETURN_IF_ERROR(AddMesh(mesh, place));
    }
    TESSERA_RETURN_IF_ERROR(push(*node, "children", place));
  }
  return absl::OkStatus();
}

absl::StatusOr<TriangleMesh> GltfReader::Read() {
  if (const auto required = root_.find("extensionsRequired");
      required != root_.end() && required->is_array() && !required->empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the file requires ", required->size(), " extensions; none is read here"));
  }
  if (root_.contains("scenes")) {
    TESSERA_ASSIGN_OR_RETURN(const uint64_t index, Whole(root_, "scene", 0));
    TESSERA_ASSIGN_OR_RETURN(const GltfJson* scene, Element(root_, "scenes", index));
    TESSERA_RETURN_IF_ERROR(AddNodes(*scene));
  } else if (const auto meshes = root_.find("meshes"); meshes != root_.end() && meshes->is_array()) {
    for (uint64_t i = 0; i < meshes->size(); ++i) {
      TESSERA_RETURN_IF_ERROR(AddMesh(i, Eigen::Affine3d::Identity()));
    }
  }
  return std::move(mesh_);
}

uint32_t WordAt(std::string_view bytes, size_t offset) {
  uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof(word));
  return word;
}

// Takes the chunk of `type` off the front of `bytes`.
absl::StatusOr<std::string_view> TakeChunk(std::string_view& bytes, uint32_t type, std::string_view name) {
  if (bytes.size() < 8 || WordAt(bytes, 4) != type || WordAt(bytes, 0) > bytes.size() - 8) {
    return absl::InvalidArgumentError(
        absl::StrCat("the chunk '", std::string(name), "' is missing or cut off"));
  }
  const std::string_view chunk = bytes.substr(8, WordAt(bytes, 0));
  bytes.remove_prefix(8 + chunk.size());
  return chunk;
}

// One vertex for each place, the first of those there.
void MergeVertices(TriangleMesh& mesh, TriangleReadNotes& notes) {
  std::vector<uint32_t> order(mesh.positions.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto key = [&](uint32_t v) {
    const Eigen::Vector3f& p = mesh.positions[v];
    return std::tuple(p.x(), p.y(), p.z(), v);
  };
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
  std::vector<uint32_t> merged(order.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && mesh.positions[order[i]] == mesh.positions[order[i - 1]];
    merged[order[i]] = same ? merged[order[i - 1]] : order[i];
    notes.vertices_merged += same;
  }
  for (Triangle& triangle : mesh.triangles) {
    for (uint32_t& v : triangle) {
      v = merged[v];
    }
  }
  std::erase_if(mesh.triangles,
                [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
}

}  // namespace

absl::StatusOr<TriangleMesh> ParseGltf(std::string_view bytes, const std::filesystem::path& folder,
                                       TriangleReadNotes& notes) {
  std::string_view json = bytes;
  std::optional<std::string_view> binary;
  if (bytes.size() >= 4 && WordAt(bytes, 0) == kGlbMagic) {
    if (bytes.size() < 12 || WordAt(bytes, 4) != 2) {
      return absl::InvalidArgumentError("not GLB of version 2");
    }
    if (WordAt(bytes, 8) > bytes.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("the file is cut off: ", WordAt(bytes, 8), " bytes named, ", bytes.size(), " found"));
    }
    std::string_view rest = bytes.substr(12);
    TESSERA_ASSIGN_OR_RETURN(json, TakeChunk(rest, kGlbJsonChunk, "JSON"));
    if (!rest.empty()) {
      TESSERA_ASSIGN_OR_RETURN(binary, TakeChunk(rest, kGlbBinChunk, "BIN"));
    }
  }
  if (json.size() > kMaxJsonBytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat("the JSON has ", json.size(), " bytes; the limit is ", kMaxJsonBytes));
  }
  GltfJson root = GltfJson::parse(json, nullptr, /*allow_exceptions=*/false);
  if (!root.is_object()) {
    return absl::InvalidArgumentError("the JSON is cut off or malformed");
  }
  TESSERA_ASSIGN_OR_RETURN(TriangleMesh mesh, GltfReader(std::move(root), binary, folder).Read());
  MergeVertices(mesh, notes);
  return mesh;
}

}  // namespace tessera
