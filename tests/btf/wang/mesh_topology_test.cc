#include "btf/wang/mesh_topology.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/wang/shapes.h"
#include "tests/btf/wang/meshes.h"

namespace tessera {
namespace {

using testing::HasSubstr;

TEST(BuildAdjacencyTest, SidesAcrossAreMutualAndShareTheirVertices) {
  const QuadMesh cube = Cube();
  const QuadAdjacency adjacency = *BuildAdjacency(cube);
  for (int face = 0; face < 6; ++face) {
    for (int side = 0; side < 4; ++side) {
      const auto [other, other_side] = adjacency.across[face][side];
      ASSERT_GE(other, 0);
      EXPECT_EQ(adjacency.across[other][other_side].face, face);
      EXPECT_EQ(adjacency.across[other][other_side].side, side);
      EXPECT_EQ(cube.quads[face][side], cube.quads[other][(other_side + 1) % 4]);
    }
  }
  EXPECT_EQ(ListEdges(adjacency).keys.size(), 12u);
}

TEST(BuildAdjacencyTest, OpenSidesHaveNothingAcross) {
  const QuadAdjacency adjacency = *BuildAdjacency(Strip(2, 1, Closing::kOpen));
  EXPECT_EQ(adjacency.across[0][1].face, 1);
  EXPECT_EQ(adjacency.across[0][1].side, 3);
  EXPECT_EQ(adjacency.across[0][0].face, -1);
}

TEST(BuildAdjacencyTest, NamesTheEdgeAndTheFaces) {
  QuadMesh turned = Cube();
  std::swap(turned.quads[2][1], turned.quads[2][3]);
  EXPECT_THAT(
      std::string(BuildAdjacency(turned).status().message()),
      HasSubstr("not oriented: faces 1 and 3 run in the same direction along the edge between vertices 1 at "
                "(0, 0, 0) and 2 at (1, 0, 0)"));
  QuadMesh fin = Cube();
  fin.positions.push_back({2, 0, 0});
  fin.positions.push_back({2, 1, 0});
  fin.quads.push_back({1, 8, 9, 3});
  EXPECT_THAT(
      std::string(BuildAdjacency(fin).status().message()),
      HasSubstr("not a manifold: the edge between vertices 2 at (1, 0, 0) and 4 at (1, 1, 0) is shared by 3 "
                "faces (1, 6, 7); at most 2 may meet at an edge"));
}

TEST(OrientFacesTest, RestoresAnyWindingUpToTheMajority) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const QuadMesh original = RandomPolycube(seed);
    QuadMesh mesh = original;
    Rng rng(seed + 100);
    for (Quad& quad : mesh.quads) {
      if (rng.NextBelow(4) == 0) {
        std::swap(quad[1], quad[3]);
      }
    }
    const auto turned = OrientFaces(mesh);
    ASSERT_TRUE(turned.ok()) << turned.status();
    EXPECT_TRUE(BuildAdjacency(mesh).ok());
    EXPECT_LE(*turned, mesh.quads.size() / 2);
    EXPECT_EQ(*OrientFaces(mesh), 0u) << "nothing is left to turn";
  }
}

TEST(OrientFacesTest, RefusesAMoebiusStripOfAnySize) {
  for (uint32_t columns = 3; columns < 8; ++columns) {
    for (uint32_t rows = 1; rows < 4; ++rows) {
      QuadMesh mesh = Strip(columns, rows, Closing::kMoebius);
      const auto turned = OrientFaces(mesh);
      EXPECT_EQ(turned.status().code(), absl::StatusCode::kInvalidArgument);
      EXPECT_THAT(std::string(turned.status().message()), HasSubstr("edge between vertices"));
      QuadMesh band = Strip(columns, rows, Closing::kBand);
      EXPECT_TRUE(OrientFaces(band).ok());
    }
  }
}

TEST(SplitSingularVerticesTest, GivesEveryFanItsOwnVertex) {
  // Two quads that meet in vertex 2 only.
  QuadMesh mesh;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {2, 1, 0}, {2, 2, 0}, {1, 2, 0}};
  mesh.quads = {{0, 1, 2, 3}, {2, 4, 5, 6}};
  mesh = WithNormals(std::move(mesh));
  EXPECT_EQ(SplitSingularVertices(mesh, *BuildAdjacency(mesh)), 1u);
  EXPECT_EQ(mesh.quads[0], (Quad{0, 1, 2, 3}));
  EXPECT_EQ(mesh.quads[1], (Quad{7, 4, 5, 6}));
  EXPECT_EQ(mesh.positions[7], mesh.positions[2]);
  EXPECT_TRUE(ValidateQuadMesh(mesh).ok());
  EXPECT_EQ(SplitSingularVertices(mesh, *BuildAdjacency(mesh)), 0u);
}

TEST(DescribeMeshTest, CountsHandlesAndHoles) {
  const auto facts = [](const QuadMesh& mesh) {
    const auto info = DescribeMesh(mesh);
    EXPECT_TRUE(info.ok()) << info.status();
    return std::tuple(info->genus, info->num_boundary_loops, info->num_components);
  };
  EXPECT_EQ(facts(Cube()), std::tuple(0, 0, 1));
  EXPECT_EQ(facts(Strip(4, 3, Closing::kOpen)), std::tuple(0, 1, 1));
  EXPECT_EQ(facts(Strip(5, 1, Closing::kBand)), std::tuple(0, 2, 1));
  EXPECT_EQ(facts(*BuiltinShape("torus")), std::tuple(1, 0, 1));
  QuadMesh two = Cube();
  const QuadMesh torus = *BuiltinShape("torus");
  const auto offset = static_cast<uint32_t>(two.positions.size());
  two.positions.insert(two.positions.end(), torus.positions.begin(), torus.positions.end());
  two.normals.insert(two.normals.end(), torus.normals.begin(), torus.normals.end());
  for (const Quad& quad : torus.quads) {
    two.quads.push_back({quad[0] + offset, quad[1] + offset, quad[2] + offset, quad[3] + offset});
  }
  EXPECT_EQ(facts(two), std::tuple(1, 0, 2));
}

TEST(DescribeMeshTest, MeasuresTheCube) {
  const MeshInfo info = *DescribeMesh(Cube());
  EXPECT_EQ(info.num_vertices, 8u);
  EXPECT_EQ(info.num_quads, 6u);
  EXPECT_EQ(info.num_edges, 12u);
  EXPECT_EQ(info.num_irregular_vertices, 8u);
  EXPECT_EQ(info.min_edge, 1.0);
  EXPECT_EQ(info.max_edge, 1.0);
  EXPECT_EQ(info.median_area, 1.0);
  EXPECT_EQ(info.box_max, Eigen::Vector3f(1, 1, 1));
}

TEST(ValidateQuadMeshTest, NamesTheVertexOrFace) {
  const auto message = [](const QuadMesh& mesh) { return std::string(ValidateQuadMesh(mesh).message()); };
  QuadMesh mesh = Cube();
  mesh.normals[2] *= 2.0f;
  EXPECT_THAT(message(mesh), HasSubstr("vertex 3: the normal has length 2"));
  mesh.normals[2].setConstant(std::numeric_limits<float>::quiet_NaN());
  EXPECT_THAT(message(mesh), HasSubstr("vertex 3: the normal has length nan"));
  mesh.normals.pop_back();
  EXPECT_THAT(message(mesh), HasSubstr("7 normals for 8 vertices"));
  mesh = Cube();
  mesh.quads[5][0] = 4000000000u;
  EXPECT_THAT(message(mesh), HasSubstr("face 6: vertex 4000000001 does not exist"));
}

TEST(ComputeNormalsTest, AreExactOnASphereAndUnitOnACube) {
  const QuadMesh sphere = *BuiltinShape("cube-sphere");
  const auto normals = ComputeNormals(sphere);
  // The weights are exact for vertices on a sphere; what is left is the rounding of positions to float32,
  // 6e-8 relative to edges of 0.1.
  constexpr double kTolerance = 5e-6;
  for (size_t v = 0; v < normals.size(); ++v) {
    EXPECT_LT((normals[v] - sphere.positions[v]).cast<double>().norm(), kTolerance);
  }
  for (const Eigen::Vector3f& normal : ComputeNormals(Cube())) {
    EXPECT_NEAR(normal.norm(), 1.0, 1e-6);
  }
}

}  // namespace
}  // namespace tessera
