#include "btf/wang/mesh_io.h"

#include <fstream>
#include <span>
#include <string>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/wang/mesh_topology.h"
#include "tests/btf/wang/meshes.h"

namespace tessera {
namespace {

using testing::HasSubstr;

absl::StatusOr<QuadMesh> Parse(const std::string& text, std::string_view name = "m.obj",
                               MeshReadNotes* notes = nullptr) {
  return ParseQuadMesh(std::as_bytes(std::span(text)), name, notes);
}
std::string Error(const std::string& text, std::string_view name = "m.obj") {
  const auto mesh = Parse(text, name);
  EXPECT_FALSE(mesh.ok());
  return std::string(mesh.status().message());
}

constexpr char kSquare[] = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

TEST(ObjTest, ReadsAllFormsOfCorners) {
  for (const char* face :
       {"f 1 2 3 4", "f 1/9 2/9 3/9 4/9", "f 1//1 2//1 3//1 4//1", "f 1/2/1 2/2/1 3/2/1 4/2/1",
        "f -4 -3 -2 -1", "f 1 2 \\\n 3 4", "  f\t1 2 3 4  # a comment\r"}) {
    const auto mesh = Parse(
        absl::StrCat("# exported\r\nmtllib a.mtl\no square\n", kSquare, "vn 0 0 2\ns off\n", face, "\n"));
    ASSERT_TRUE(mesh.ok()) << face << ": " << mesh.status();
    EXPECT_EQ(mesh->quads, (std::vector<Quad>{{0, 1, 2, 3}})) << face;
    EXPECT_EQ(mesh->positions[2], Eigen::Vector3f(1, 1, 0));
    EXPECT_EQ(mesh->normals[0], Eigen::Vector3f(0, 0, 1)) << face;
  }
}

TEST(ObjTest, RefusesOtherFacesByNameAndNumber) {
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1 2 3 4\nf 1 2 3\nf 1 2 4\n")),
              HasSubstr("m.obj: face 2 (line 6) is a triangle; only quads can be dressed (2 of 3 faces"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "v 2 2 2\nf 1 2 3 4 5\n")),
              HasSubstr("face 1 (line 6) is an n-gon of 5 corners"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1 2\n")), HasSubstr("face 1 (line 5) is a face of 2 corners"));
  // 260 corners would be 4 in the 8 bits that some readers count them with.
  std::string polygon = "f";
  for (int i = 0; i < 260; ++i) {
    polygon += absl::StrCat(" ", i % 4 + 1);
  }
  EXPECT_THAT(Error(absl::StrCat(kSquare, polygon)), HasSubstr("n-gon of 260 corners"));
}

TEST(ObjTest, RefusesDamagedNumbersByLine) {
  EXPECT_THAT(Error("v 0 0 nan\n"), HasSubstr("line 1: 'nan' is not a finite number"));
  EXPECT_THAT(Error("v 0 inf 0\n"), HasSubstr("line 1: 'inf'"));
  EXPECT_THAT(Error("v 0 1e39 0\n"), HasSubstr("'1e39'"));
  EXPECT_THAT(Error("v 0 1,5 0\n"), HasSubstr("'1,5'"));
  EXPECT_THAT(Error("v 0 +-5 0\n"), HasSubstr("'+-5'"));
  EXPECT_THAT(Error("\nv 0 1\n"), HasSubstr("line 2: a vertex of 2 numbers"));
  EXPECT_THAT(Error("v 0 0 0\rv 1 0 0\rv 1 1 0\r"), HasSubstr("a vertex of 11 numbers"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1 2 3 x\n")), HasSubstr("line 5: 'x' is not a whole number"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1 2 3 4.5\n")), HasSubstr("'4.5'"));
  EXPECT_THAT(Error(absl::StrCat("v 0 0 ", std::string(5000, '\x1b'))),
              HasSubstr("'????????????????????????????????..'"));
  EXPECT_TRUE(Parse("v +0 .0 -0.\nv 1e0 0 0 1\nv 1 1 0 1 0.5 0.5 0.5\nv 0 1 0 .1 .2 .3\nf 1 2 3 4").ok());
}

TEST(ObjTest, RefusesMissingAndRepeatedElementsByFace) {
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1 2 3 5\n")),
              HasSubstr("face 1: vertex 5 does not exist; the mesh has 4"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1 2 3 0\n")), HasSubstr("line 5: the face names vertex 0"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1 2 3 -5\n")), HasSubstr("vertex -5"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1 2 3 99999999999\n")), HasSubstr("vertex 99999999999"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1 2 3 2\n")), HasSubstr("face 1: vertex 2 occurs twice"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "v 1 0 0\nf 1 2 5 4\n")),
              HasSubstr("face 1: side 2 has no length"));
  EXPECT_THAT(Error(absl::StrCat(kSquare, "f 1//1 2//1 3//1 4//1\n")), HasSubstr("normal 1 does not exist"));
  EXPECT_THAT(Error(kSquare), HasSubstr("the mesh has no faces"));
  EXPECT_THAT(Error(""), HasSubstr("no faces"));
}

TEST(ObjTest, NormalsThatFaceTheOtherWayArePassedOver) {
  const auto mesh = Parse(absl::StrCat(kSquare, "vn 0 0 -1\nvn 0 0.6 0.8\nvn 0 0 0\nf 1//1 2//2 3//3 4\n"));
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->normals[0], Eigen::Vector3f(0, 0, 1));
  EXPECT_TRUE(mesh->normals[1].isApprox(Eigen::Vector3f(0, 0.6f, 0.8f)));
  EXPECT_EQ(mesh->normals[2], Eigen::Vector3f(0, 0, 1));
  EXPECT_EQ(mesh->normals[3], Eigen::Vector3f(0, 0, 1));
}

TEST(ObjTest, TurnsFacesToTheMajorityWithTheirNormals) {
  MeshReadNotes notes;
  const auto mesh = Parse(
      "v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\nv 3 1 0\nv 9 9 9\n"
      "f 1 2 6 5\nf 3 2 6 7\nf 3 4 8 7\n",
      "m.obj", &notes);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(notes.faces_turned, 1u);
  EXPECT_EQ(notes.vertices_dropped, 1u);
  EXPECT_EQ(mesh->quads[1], (Quad{2, 6, 5, 1}));
  for (const Eigen::Vector3f& normal : mesh->normals) {
    EXPECT_EQ(normal, Eigen::Vector3f(0, 0, 1));
  }
}

TEST(OffTest, ReadsHeadersNormalsAndColours) {
  const std::string body = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";
  for (const std::string& text :
       {"OFF\n4 1 4\n" + body + "4 0 1 2 3\n", "OFF 4 1 0\n" + body + "4 0 1 2 3 255 0 0\n",
        "# made by hand\nOFF # keyword\n\n4 1\n" + body + "\n4 0 1 2 3"}) {
    const auto mesh = Parse(text, "M.OFF");
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(mesh->quads, (std::vector<Quad>{{0, 1, 2, 3}}));
  }
  const auto with_normals =
      Parse("NOFF\n4 1 0\n0 0 0 0 0 1\n1 0 0 0 .6 .8\n1 1 0 0 0 1\n0 1 0 0 0 1\n4 0 1 2 3\n", "m.off");
  ASSERT_TRUE(with_normals.ok()) << with_normals.status();
  EXPECT_TRUE(with_normals->normals[1].isApprox(Eigen::Vector3f(0, 0.6f, 0.8f)));
}

TEST(OffTest, RefusesWhatItMustByPlace) {
  EXPECT_THAT(Error("", "m.off"), HasSubstr("m.off: the file is empty"));
  EXPECT_THAT(Error("PLY\n", "m.off"), HasSubstr("does not start with OFF"));
  EXPECT_THAT(Error("OFF BINARY\n", "m.off"), HasSubstr("binary OFF is not read"));
  EXPECT_THAT(Error("OFF\n", "m.off"), HasSubstr("ends before the counts"));
  EXPECT_THAT(Error("OFF\n4\n", "m.off"), HasSubstr("counts of vertices and faces are missing"));
  EXPECT_THAT(Error("OFF\n-4 1 0\n", "m.off"), HasSubstr("-4 vertices"));
  EXPECT_THAT(Error("OFF\n99999999999 1 0\n", "m.off"), HasSubstr("99999999999 vertices; the limit is"));
  EXPECT_THAT(Error("OFF\n4 4000000000 0\n", "m.off"), HasSubstr("4000000000 faces; the limit is 4194304"));
  EXPECT_THAT(Error("OFF\n4 1 0\n0 0 0\n", "m.off"), HasSubstr("ends after 1 of 4 vertices"));
  EXPECT_THAT(Error("OFF\n1 2 0\n0 0 0\n", "m.off"), HasSubstr("ends after 0 of 2 faces"));
  EXPECT_THAT(Error("OFF\n1 1 0\n0 0 0\n4 0 0 0\n", "m.off"),
              HasSubstr("face 1 claims 4 corners and lists 3"));
  EXPECT_THAT(Error("OFF\n1 1 0\n0 0 0\n4 0 0 0 7\n", "m.off"),
              HasSubstr("line 4: face 1 names vertex 7, expected 0 to 0"));
  EXPECT_THAT(Error("OFF\n1 1 0\n0 0 0\n-1\n", "m.off"), HasSubstr("face 1 claims -1 corners"));
  EXPECT_THAT(Error("OFF\n3 1 0\n0 0 0\n1 0 0\n1 1 0\n3 0 1 2\n", "m.off"),
              HasSubstr("face 1 (line 6) is a triangle"));
}

TEST(ParseQuadMeshTest, RefusesUnknownExtensions) {
  EXPECT_THAT(Error("", "m.ply"), HasSubstr("m.ply: the extension is neither .obj nor .off"));
  EXPECT_THAT(Error("", "obj"), HasSubstr("neither"));
}

TEST(ParseQuadMeshTest, NamesTheEdgeThatIsNoManifold) {
  EXPECT_THAT(
      Error(absl::StrCat(kSquare, "v 0 0 1\nv 1 0 1\nv 0 0 -1\nv 1 0 -1\nf 1 2 3 4\nf 1 2 6 5\nf 2 1 7 8\n")),
      HasSubstr("not a manifold: the edge between vertices 1 at (0, 0, 0) and 2 at (1, 0, 0) is shared by 3 "
                "faces (1, 2, 3)"));
}

TEST(ParseQuadMeshTest, NamesTheEdgeThatCannotBeOriented) {
  const QuadMesh band = Strip(7, 1, Closing::kMoebius);
  std::string text;
  for (const Eigen::Vector3f& p : band.positions) {
    absl::StrAppend(&text, "v ", p.x(), " ", p.y(), " ", p.z(), "\n");
  }
  for (const Quad& q : band.quads) {
    absl::StrAppend(&text, "f ", q[0] + 1, " ", q[1] + 1, " ", q[2] + 1, " ", q[3] + 1, "\n");
  }
  EXPECT_THAT(Error(text), HasSubstr("not orientable: faces "));
  EXPECT_THAT(Error(text), HasSubstr("edge between vertices"));
}

TEST(ParseQuadMeshTest, CutAndDamagedFilesNeverCrashAndNeverPassUnnoticedInOff) {
  std::string text = "OFF\n8 6 12\n";
  const QuadMesh cube = Cube();
  for (const Eigen::Vector3f& p : cube.positions) {
    absl::StrAppend(&text, p.x(), " ", p.y(), " ", p.z(), "\n");
  }
  for (const Quad& q : cube.quads) {
    absl::StrAppend(&text, "4 ", q[0], " ", q[1], " ", q[2], " ", q[3], "\n");
  }
  ASSERT_TRUE(Parse(text, "m.off").ok());
  for (size_t length = 0; length + 2 < text.size(); ++length) {
    EXPECT_FALSE(Parse(text.substr(0, length), "m.off").ok()) << length;
  }
  Rng rng(1);
  for (int i = 0; i < 20000; ++i) {
    std::string damaged = text;
    for (uint64_t n = 1 + rng.NextBelow(4); n > 0; --n) {
      damaged[rng.NextBelow(damaged.size())] = "0123456789-.eE \n#\\/fv\xff"[rng.NextBelow(22)];
    }
    for (const char* name : {"m.off", "m.obj"}) {
      if (const auto mesh = Parse(damaged, name); mesh.ok()) {
        EXPECT_TRUE(ValidateQuadMesh(*mesh).ok());
        EXPECT_TRUE(BuildAdjacency(*mesh).ok());
      }
    }
  }
}

TEST(ReadQuadMeshTest, NamesTheFile) {
  EXPECT_EQ(ReadQuadMesh("/nowhere/m.obj").status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ReadQuadMesh(testing::TempDir()).status().code(), absl::StatusCode::kInvalidArgument);
  const std::string path = testing::TempDir() + "/tessera_mesh_io_test.obj";
  std::ofstream(path) << kSquare << "f 1 2 3 4\n";
  EXPECT_TRUE(ReadQuadMesh(path).ok());
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace tessera
