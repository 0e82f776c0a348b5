#include "btf/remesh/triangle_mesh_io.h"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <span>
#include <string>

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/btf/remesh/triangles.h"

namespace tessera {
namespace {

using testing::HasSubstr;

absl::StatusOr<TriangleMesh> Parse(const std::string& bytes, std::string_view name,
                                   TriangleReadNotes* notes = nullptr,
                                   const std::filesystem::path& folder = {}) {
  return ParseTriangleMesh(std::as_bytes(std::span(bytes)), name, folder, notes);
}
std::string Error(const std::string& bytes, std::string_view name) {
  const auto mesh = Parse(bytes, name);
  EXPECT_FALSE(mesh.ok());
  return std::string(mesh.status().message());
}

// A tetrahedron, wound outwards.
const std::vector<Eigen::Vector3f> kCorners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
const std::vector<Triangle> kFaces{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

void ExpectTetrahedron(const absl::StatusOr<TriangleMesh>& mesh) {
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->positions, kCorners);
  EXPECT_EQ(mesh->triangles, kFaces);
}

template <typename T>
void Append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
}

std::string PlyHead(std::string_view format, uint64_t vertices, uint64_t faces) {
  return absl::StrCat(
      "ply\nformat ", std::string(format), " 1.0\ncomment by hand\nelement vertex ", vertices,
      "\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nelement face ", faces,
      "\nproperty list uchar int vertex_indices\nend_header\n");
}

std::string BinaryPly() {
  std::string bytes = PlyHead("binary_little_endian", 4, 4);
  for (const Eigen::Vector3f& p : kCorners) {
    Append(bytes, p.x());
    Append(bytes, p.y());
    Append(bytes, p.z());
    Append(bytes, uint8_t{200});
  }
  for (const Triangle& face : kFaces) {
    Append(bytes, uint8_t{3});
    for (const uint32_t v : face) {
      Append(bytes, static_cast<int32_t>(v));
    }
  }
  return bytes;
}

constexpr char kPlyVertices[] = "0 0 0 9\n1 0 0 9\n0 1 0 9\n0 0 1 9\n";

TEST(TriangleTextTest, ReadsObjAndOffAndFansLargerFaces) {
  const std::string vertices = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  ExpectTetrahedron(
      Parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1//1 2/1 4\nf 2 3 4\nf -2 -4 -1\n", "t.obj"));
  ExpectTetrahedron(Parse("OFF 4 4 6\n" + vertices + "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n", "t.off"));
  TriangleReadNotes notes;
  const auto cube = Parse(
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n"
      "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 8 4\nf 2 6 8\n",
      "c.obj", &notes);
  ASSERT_TRUE(cube.ok()) << cube.status();
  EXPECT_EQ(notes.faces_fanned, 5u);
  EXPECT_EQ(notes.triangles_turned, 2u);
  EXPECT_EQ(cube->triangles.size(), 12u);
}

TEST(TriangleTextTest, RefusesByPlace) {
  EXPECT_THAT(Error("v 0 0 nan\n", "t.obj"), HasSubstr("t.obj: line 1: 'nan' is not a finite number"));
  EXPECT_THAT(Error("v 0 0 0\nv 1 0 0\nf 1 2\n", "t.obj"),
              HasSubstr("face 1 (line 3) is a face of 2 corners; expected three corners or more"));
  EXPECT_THAT(Error("v 0 0 0\nv 1 0 0\nf 1 2 3\n", "t.obj"),
              HasSubstr("vertex 3 does not exist; the mesh has 2"));
  EXPECT_THAT(Error("OFF\n1 1 0\n0 0 0\n3 0 0 1\n", "t.off"), HasSubstr("names vertex 1, expected 0 to 0"));
  EXPECT_THAT(Error("", "t.stl"), HasSubstr("none of .obj, .off, .ply, .gltf and .glb"));
}

TEST(PlyTest, ReadsTextAndBinary) {
  ExpectTetrahedron(
      Parse(PlyHead("ascii", 4, 4) + kPlyVertices + "3 0 2 1\n3 0 1 3\n3 1 2 3 3 2 0 3\n", "t.ply"));
  ExpectTetrahedron(Parse(BinaryPly(), "T.PLY"));
}

TEST(PlyTest, EveryCutIsNoticed) {
  const std::string whole = BinaryPly();
  for (size_t length = 0; length < whole.size(); ++length) {
    EXPECT_FALSE(Parse(whole.substr(0, length), "t.ply").ok()) << length;
  }
  EXPECT_THAT(Error(whole.substr(0, whole.size() - 1), "t.ply"),
              HasSubstr("t.ply: face 4 of 4: the file is cut off here"));
}

TEST(PlyTest, RefusesByPlace) {
  const std::string head = PlyHead("ascii", 4, 1) + kPlyVertices;
  EXPECT_THAT(Error("plx\n", "t.ply"), HasSubstr("does not start with ply"));
  EXPECT_THAT(Error("ply\nformat binary_big_endian 1.0\nend_header\n", "t.ply"),
              HasSubstr("line 2: the format is neither"));
  EXPECT_THAT(Error("ply\nend_header\n", "t.ply"), HasSubstr("names no format"));
  EXPECT_THAT(Error(std::string("ply\n") + std::string(100000, 'c'), "t.ply"),
              HasSubstr("does not end within 65536 bytes"));
  EXPECT_THAT(Error(PlyHead("ascii", 99999999999, 1), "t.ply"),
              HasSubstr("99999999999 elements 'vertex'; the limit is 16777216"));
  EXPECT_THAT(Error(PlyHead("ascii", 4, 5000000), "t.ply"), HasSubstr("the limit is 4194304"));
  EXPECT_THAT(Error(head + "3 0 1 4\n", "t.ply"),
              HasSubstr("face 1 of 1: it names vertex 4, which does not exist; the mesh has 4"));
  EXPECT_THAT(Error(head + "3 0 1 -1\n", "t.ply"), HasSubstr("vertex -1"));
  EXPECT_THAT(Error(head + "3 0 1 1.5\n", "t.ply"), HasSubstr("vertex 1.5"));
  EXPECT_THAT(Error(head + "2 0 1\n", "t.ply"), HasSubstr("2 corners, expected three or more"));
  EXPECT_THAT(Error(head + "1e9 0 1\n", "t.ply"), HasSubstr("1e+09 corners; the limit is 1024"));
  EXPECT_THAT(Error(head + "nan 0 1\n", "t.ply"), HasSubstr("a list of nan numbers"));
  EXPECT_THAT(Error(PlyHead("ascii", 1, 0) + "0 nan 0 9\n", "t.ply"),
              HasSubstr("vertex 1 of 1: the position is not finite"));
  EXPECT_THAT(Error(PlyHead("ascii", 1, 0) + "0 x 0 9\n", "t.ply"), HasSubstr("a word is not a number"));
  // Elements that take no bytes take no time either.
  EXPECT_THAT(Error("ply\nformat ascii 1.0\nelement void 18446744073709551615\nend_header\n", "t.ply"),
              HasSubstr("no faces"));
}

// Every face has its own three vertices, as exporters write them along seams.
std::string GltfBytes() {
  std::string bytes;
  for (const Triangle& face : kFaces) {
    for (const uint32_t v : face) {
      for (int axis = 0; axis < 3; ++axis) {
        Append(bytes, kCorners[v][axis]);
      }
    }
  }
  for (uint16_t i = 0; i < 12; ++i) {
    Append(bytes, i);
  }
  return bytes;
}

nlohmann::json GltfOf(const nlohmann::json& buffer) {
  return {{"asset", {{"version", "2.0"}}},
          {"scenes", {{{"nodes", {0}}}}},
          {"nodes", {{{"mesh", 0}}}},
          {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"indices", 1}}}}}}},
          {"accessors",
           {{{"bufferView", 0}, {"componentType", 5126}, {"count", 12}, {"type", "VEC3"}},
            {{"bufferView", 1}, {"componentType", 5123}, {"count", 12}, {"type", "SCALAR"}}}},
          {"bufferViews",
           {{{"buffer", 0}, {"byteLength", 144}}, {{"buffer", 0}, {"byteOffset", 144}, {"byteLength", 24}}}},
          {"buffers", {buffer}}};
}

nlohmann::json Embedded() {
  return GltfOf({{"byteLength", 168},
                 {"uri", "data:application/octet-stream;base64," + absl::Base64Escape(GltfBytes())}});
}

std::string Glb() {
  std::string json = GltfOf({{"byteLength", 168}}).dump();
  json.resize((json.size() + 3) / 4 * 4, ' ');
  std::string bytes;
  Append(bytes, uint32_t{0x46546C67});
  Append(bytes, uint32_t{2});
  Append(bytes, static_cast<uint32_t>(12 + 8 + json.size() + 8 + 168));
  Append(bytes, static_cast<uint32_t>(json.size()));
  Append(bytes, uint32_t{0x4E4F534A});
  bytes += json;
  Append(bytes, uint32_t{168});
  Append(bytes, uint32_t{0x004E4942});
  return bytes + GltfBytes();
}

void ExpectMergedTetrahedron(const absl::StatusOr<TriangleMesh>& mesh, const TriangleReadNotes& notes) {
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles.size(), 4u);
  EXPECT_EQ(notes.vertices_merged, 8u);
  EXPECT_EQ(CheckClosedSurface(*mesh)->genus, 0);
}

TEST(GltfTest, ReadsEmbeddedBinaryAndSiblingBuffers) {
  TriangleReadNotes notes;
  ExpectMergedTetrahedron(Parse(Embedded().dump(), "t.gltf", &notes), notes);
  notes = {};
  ExpectMergedTetrahedron(Parse(Glb(), "t.glb", &notes), notes);
  const std::filesystem::path folder = testing::TempDir();
  std::ofstream(folder / "tetrahedron.bin", std::ios::binary) << GltfBytes();
  std::ofstream(folder / "t.gltf") << GltfOf({{"byteLength", 168}, {"uri", "tetrahedron.bin"}}).dump();
  notes = {};
  ExpectMergedTetrahedron(ReadTriangleMesh(folder / "t.gltf", &notes), notes);
}

TEST(GltfTest, NodesPlaceTheirMeshes) {
  nlohmann::json json = Embedded();
  json["nodes"] = {{{"children", {1, 2}}, {"translation", {10, 0, 0}}},
                   {{"mesh", 0}, {"scale", {2, 2, 2}}},
                   {{"mesh", 0}, {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -5, 0, 0, 1}}}};
  TriangleReadNotes notes;
  const auto mesh = Parse(json.dump(), "t.gltf", &notes);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(CheckClosedSurface(*mesh)->num_components, 2u);
  EXPECT_EQ(notes.triangles_turned, 0u);
  EXPECT_THAT(mesh->positions, testing::Contains(Eigen::Vector3f(12, 0, 0)));
  EXPECT_THAT(mesh->positions, testing::Contains(Eigen::Vector3f(4, 0, 0)));
}

TEST(GltfTest, EveryCutIsNoticed) {
  const std::string whole = Glb();
  for (size_t length = 0; length < whole.size(); ++length) {
    EXPECT_FALSE(Parse(whole.substr(0, length), "t.glb").ok()) << length;
  }
}

TEST(GltfTest, RefusesByPlace) {
  const auto error = [](const char* path, const nlohmann::json& value) {
    nlohmann::json json = Embedded();
    json[nlohmann::json::json_pointer(path)] = value;
    return Error(json.dump(), "t.gltf");
  };
  EXPECT_THAT(Error("{", "t.gltf"), HasSubstr("t.gltf: the JSON is cut off or malformed"));
  EXPECT_THAT(error("/accessors/0/count", 13), HasSubstr("accessor 0: 13 elements end beyond the 144 bytes"));
  EXPECT_THAT(error("/accessors/0/count", 99999999999),
              HasSubstr("99999999999 elements; the limit is 16777216"));
  EXPECT_THAT(error("/accessors/0/byteOffset", 4), HasSubstr("elements end beyond"));
  EXPECT_THAT(error("/accessors/0/count", -1), HasSubstr("'count' is missing or not a whole number"));
  EXPECT_THAT(error("/accessors/0/sparse", 1), HasSubstr("accessor 0: sparse or compressed"));
  EXPECT_THAT(error("/accessors/0/type", "VEC2"), HasSubstr("the type is not VEC3"));
  EXPECT_THAT(error("/accessors/1/componentType", 5126), HasSubstr("component type 5126"));
  EXPECT_THAT(error("/accessors/0/bufferView", 2), HasSubstr("element 2 of 'bufferViews' does not exist"));
  EXPECT_THAT(error("/bufferViews/1/byteLength", 25),
              HasSubstr("buffer view 1: it ends beyond the 168 bytes"));
  EXPECT_THAT(error("/bufferViews/0/byteStride", 8), HasSubstr("a stride of 8 bytes"));
  EXPECT_THAT(error("/buffers/0/byteLength", 169), HasSubstr("buffer 0: 169 bytes named, 168 found"));
  EXPECT_THAT(error("/buffers/0/uri", "../secret.bin"), HasSubstr("not the plain name of a file"));
  EXPECT_THAT(error("/buffers/0/uri", "data:;base64,!!"), HasSubstr("not base64"));
  EXPECT_THAT(error("/nodes/0/children", nlohmann::json{0}), HasSubstr("node 0: it occurs twice"));
  EXPECT_THAT(error("/nodes/0/translation", nlohmann::json{0, 0}), HasSubstr("not a list of 3 numbers"));
  EXPECT_THAT(error("/scenes/0/nodes/0", 7), HasSubstr("element 7 of 'nodes' does not exist"));
  EXPECT_THAT(error("/meshes/0/primitives/0/mode", 5), HasSubstr("mesh 0: a primitive of mode 5"));
  EXPECT_THAT(error("/extensionsRequired", nlohmann::json{"KHR_draco_mesh_compression"}),
              HasSubstr("requires 1 extensions"));
  std::string bytes = GltfBytes();
  const uint16_t index = 12;
  std::memcpy(bytes.data() + 144, &index, sizeof(index));
  EXPECT_THAT(error("/buffers/0/uri", "data:;base64," + absl::Base64Escape(bytes)),
              HasSubstr("index 0 names vertex 12, which does not exist; accessor 0 has 12"));
  bytes = GltfBytes();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + 12, &nan, sizeof(nan));
  EXPECT_THAT(error("/buffers/0/uri", "data:;base64," + absl::Base64Escape(bytes)),
              HasSubstr("accessor 0: position 1 is not finite"));
}

}  // namespace
}  // namespace tessera
