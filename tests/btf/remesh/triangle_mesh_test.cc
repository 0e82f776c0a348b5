#include "btf/remesh/triangle_mesh.h"

#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/wang/shapes.h"
#include "tests/btf/remesh/triangles.h"

namespace tessera {
namespace {

using testing::HasSubstr;

std::string CheckError(const TriangleMesh& mesh) {
  return std::string(CheckClosedSurface(mesh).status().message());
}

const Eigen::Vector3f kLow(0.0f, 0.0f, 0.0f);
const Eigen::Vector3f kHigh(1.0f, 2.0f, 3.0f);

TEST(CheckClosedSurfaceTest, CountsPiecesAndHandles) {
  EXPECT_EQ(*CheckClosedSurface(Box(kLow, kHigh)), (SurfaceTopology{1, 0}));
  EXPECT_EQ(*CheckClosedSurface(Halved(*BuiltinShape("torus"))), (SurfaceTopology{1, 1}));
  EXPECT_EQ(*CheckClosedSurface(Halved(*BuiltinShape("genus3"))), (SurfaceTopology{1, 3}));
  EXPECT_EQ(*CheckClosedSurface(Together(Halved(*BuiltinShape("torus")), Box(kHigh, kHigh * 2.0f))),
            (SurfaceTopology{2, 1}));
}

TEST(CheckClosedSurfaceTest, VerticesWhereFansTouchCountForEach) {
  TriangleMesh mesh = Together(Box(kLow, kHigh), Box(kHigh, kHigh * 2.0f));
  for (Triangle& triangle : mesh.triangles) {
    for (uint32_t& v : triangle) {
      v = v == 8 ? 7 : v;
    }
  }
  EXPECT_EQ(*CheckClosedSurface(mesh), (SurfaceTopology{2, 0}));
}

TEST(CheckClosedSurfaceTest, NamesTheOpenEdge) {
  TriangleMesh mesh = Box(kLow, kHigh);
  mesh.triangles.pop_back();
  EXPECT_THAT(CheckError(mesh),
              HasSubstr("not closed: only triangle 5 lies along the edge between vertices 2 at (1, 0, 0) and "
                        "6 at (1, 0, 3)"));
}

TEST(CheckClosedSurfaceTest, NamesTheEdgeOfThreeTriangles) {
  TriangleMesh mesh = Box(kLow, kHigh);
  mesh.positions.emplace_back(9.0f, 9.0f, 9.0f);
  mesh.triangles.push_back({0, 1, 8});
  EXPECT_THAT(CheckError(mesh), HasSubstr("not a manifold: the edge between vertices 1 at (0, 0, 0) and 2 at "
                                          "(1, 0, 0) is shared by 3 triangles"));
}

TEST(CheckClosedSurfaceTest, RefusesDamagedMeshesByPlace) {
  EXPECT_THAT(CheckError({}), HasSubstr("no faces"));
  TriangleMesh mesh = Box(kLow, kHigh);
  mesh.positions[3].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(CheckError(mesh), HasSubstr("vertex 4: the position is not finite"));
  mesh = Box(kLow, kHigh);
  mesh.triangles[4][1] = 8;
  EXPECT_THAT(CheckError(mesh), HasSubstr("triangle 5: vertex 9 does not exist; the mesh has 8"));
  mesh.triangles[4][1] = mesh.triangles[4][0];
  EXPECT_THAT(CheckError(mesh), HasSubstr("triangle 5: vertex 1 occurs twice"));
  mesh = Box(kLow, kHigh);
  mesh.triangles.resize(kMaxMeshTriangles + 1, mesh.triangles[0]);
  EXPECT_EQ(CheckClosedSurface(mesh).status().code(), absl::StatusCode::kResourceExhausted);
}

TEST(OrientOutwardsTest, TurnsTheFewerAndThenAllThatFaceInwards) {
  const TriangleMesh box = Box(kLow, kHigh);
  TriangleMesh mesh = box;
  std::swap(mesh.triangles[5][1], mesh.triangles[5][2]);
  EXPECT_THAT(CheckError(mesh), HasSubstr("not oriented"));
  EXPECT_EQ(*OrientOutwards(mesh), 1u);
  EXPECT_EQ(mesh.triangles, box.triangles);
  for (Triangle& triangle : mesh.triangles) {
    std::swap(triangle[1], triangle[2]);
  }
  EXPECT_EQ(*OrientOutwards(mesh), 12u);
  EXPECT_EQ(mesh.triangles, box.triangles);
}

TEST(OrientOutwardsTest, CavitiesStayCavities) {
  TriangleMesh cavity = Box(kHigh * 0.25f, kHigh * 0.75f);
  for (Triangle& triangle : cavity.triangles) {
    std::swap(triangle[1], triangle[2]);
  }
  TriangleMesh mesh = Together(Box(kLow, kHigh), cavity);
  EXPECT_EQ(*OrientOutwards(mesh), 0u);
}

}  // namespace
}  // namespace tessera
