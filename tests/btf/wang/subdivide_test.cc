#include "btf/wang/subdivide.h"

#include <gtest/gtest.h>

#include "btf/wang/dress.h"
#include "btf/wang/mesh_topology.h"
#include "btf/wang/shapes.h"
#include "tests/btf/wang/meshes.h"

namespace tessera {
namespace {

struct Prepared {
  QuadMesh mesh;
  QuadAdjacency adjacency;
  Chords chords;
};
Prepared Prepare(QuadMesh mesh) {
  Prepared prepared{.mesh = std::move(mesh), .adjacency = {}, .chords = {}};
  prepared.adjacency = *BuildAdjacency(prepared.mesh);
  prepared.chords = FindChords(prepared.adjacency);
  return prepared;
}

TEST(FindChordsTest, CrossesOppositeSides) {
  EXPECT_EQ(Prepare(Cube()).chords.num_chords, 3u);
  EXPECT_EQ(Prepare(Strip(4, 3, Closing::kOpen)).chords.num_chords, 7u);
  EXPECT_EQ(Prepare(Strip(4, 3, Closing::kBand)).chords.num_chords, 7u);
  EXPECT_EQ(Prepare(*BuiltinShape("torus")).chords.num_chords, 32u + 14u);
}

// Any counts at all keep the mesh conforming: topology, boundary and area stay as they were.
TEST(SubdivideQuadsTest, StaysConformingForRandomCounts) {
  for (uint64_t seed = 0; seed < 30; ++seed) {
    const Prepared p = Prepare(seed % 3 == 0 ? Strip(3 + seed % 5, 2, Closing::kBand) : RandomPolycube(seed));
    Rng rng(seed);
    std::vector<uint32_t> counts(p.chords.num_chords);
    for (uint32_t& count : counts) {
      count = 1 + static_cast<uint32_t>(rng.NextBelow(4));
    }
    const QuadMesh fine = SubdivideQuads(p.mesh, p.adjacency, p.chords, counts);
    EXPECT_EQ(fine.quads.size(), SubdividedQuads(p.chords, counts));
    const auto before = DescribeMesh(p.mesh);
    const auto after = DescribeMesh(fine);
    ASSERT_TRUE(after.ok()) << after.status();
    EXPECT_EQ(after->genus, before->genus);
    EXPECT_EQ(after->num_boundary_loops, before->num_boundary_loops);
    EXPECT_EQ(after->num_components, before->num_components);
    EXPECT_EQ(after->num_irregular_vertices, before->num_irregular_vertices);
    EXPECT_EQ(after->num_vertices, fine.positions.size()) << "no vertex is left over or doubled";
    if (seed % 3 != 0) {
      // Every interior edge is shared by exactly two faces: in a closed mesh there are no others.
      EXPECT_EQ(after->num_edges * 2, after->num_quads * 4);
    }
  }
}

TEST(SubdivideQuadsTest, PartsLieInPlaceAndKeepTheirFrame) {
  const Prepared p = Prepare(Strip(1, 1, Closing::kOpen));
  // Chord 0 crosses sides 0 and 2 (columns), chord 1 sides 1 and 3 (rows).
  const QuadMesh fine = SubdivideQuads(p.mesh, p.adjacency, p.chords, {3, 2});
  ASSERT_EQ(fine.quads.size(), 6u);
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 3; ++i) {
      const Quad& quad = fine.quads[j * 3 + i];
      EXPECT_TRUE(fine.positions[quad[0]].head<2>().isApprox(Eigen::Vector2f(i / 3.0f, j / 2.0f), 1e-6f));
      EXPECT_TRUE(
          fine.positions[quad[2]].head<2>().isApprox(Eigen::Vector2f((i + 1) / 3.0f, (j + 1) / 2.0f), 1e-6f));
    }
  }
}

TEST(ChordCountsTest, ReachesTheTargetAndEvensSizes) {
  // A box of 8 x 2 x 1: six quads of three sizes.
  QuadMesh box = Cube();
  for (Eigen::Vector3f& position : box.positions) {
    position = position.cwiseProduct(Eigen::Vector3f(8, 2, 1));
  }
  box = WithNormals(std::move(box));
  const Prepared p = Prepare(box);
  for (const uint32_t target : {1u, 6u, 52u, 208u, 1000u, 100000u}) {
    const auto counts = ChordCounts(p.mesh, p.chords, target);
    const uint64_t quads = SubdividedQuads(p.chords, counts);
    EXPECT_GE(quads, 6u);
    if (target >= 52) {
      EXPECT_NEAR(static_cast<double>(quads), target, 0.25 * target);
      const MeshInfo info = *DescribeMesh(SubdivideQuads(p.mesh, p.adjacency, p.chords, counts));
      EXPECT_LE(info.max_edge / info.min_edge, 1.5) << target;
    } else {
      EXPECT_LE(quads, 2 * std::max(6u, target));
    }
  }
  EXPECT_EQ(ChordCounts(p.mesh, p.chords, 1), (std::vector<uint32_t>{1, 1, 1}));
}

TEST(ChordCountsTest, DefaultRuleEvensSizesWithinLimits) {
  EXPECT_GE(SubdividedQuads(Prepare(Cube()).chords, ChordCounts(Cube(), Prepare(Cube()).chords, 0)), 200u);
  for (const std::string_view shape : BuiltinShapeNames()) {
    const Prepared p = Prepare(*BuiltinShape(shape));
    EXPECT_EQ(SubdividedQuads(p.chords, ChordCounts(p.mesh, p.chords, 0)), p.mesh.quads.size())
        << shape << " is ready as it is";
  }
  // One long chord among many short ones is split, and nothing else.
  QuadMesh strip = Strip(20, 20, Closing::kOpen);
  for (Eigen::Vector3f& position : strip.positions) {
    position.z() = 0.0f;
    position.x() += position.x() > 10.5f ? 4.0f : 0.0f;
  }
  const Prepared p = Prepare(WithNormals(std::move(strip)));
  EXPECT_EQ(SubdividedQuads(p.chords, ChordCounts(p.mesh, p.chords, 0)), 20u * (19u + 5u));
}

TEST(ChordCountsTest, ExtremeSizesStayWithinTheLimit) {
  QuadMesh mesh = Strip(2, 2, Closing::kOpen);
  for (Eigen::Vector3f& position : mesh.positions) {
    position =
        Eigen::Vector3f(position.x() > 0.5f ? position.x() * 1e20f : 0.0f, position.y() * 1e-20f, 0.0f);
  }
  const Prepared p = Prepare(WithNormals(std::move(mesh)));
  for (const uint32_t target : {0u, 1u, 4000000u}) {
    EXPECT_LE(SubdividedQuads(p.chords, ChordCounts(p.mesh, p.chords, target)), kMaxMeshQuads);
  }
}

}  // namespace
}  // namespace tessera
