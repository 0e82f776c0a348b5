// Dressing the quad meshes at hand.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/wang/dress.h"
#include "btf/wang/mesh_io.h"
#include "btf/wang/mesh_topology.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

std::vector<std::filesystem::path> FilesIn(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".obj" || entry.path().extension() == ".off") {
      files.push_back(entry.path());
    }
  }
  return files;
}

TEST(MeasuredMeshTest, EveryQuadMeshIsDressedWithLegalNeighbours) {
  TESSERA_REQUIRE_DATA("meshes/quad");
  for (const std::filesystem::path& path : FilesIn(TestData("meshes/quad"))) {
    const auto mesh = ReadQuadMesh(path);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    for (const Arrangement& arrangement : BuiltinArrangements()) {
      const auto result = DressMesh(*mesh, arrangement, {.allow_breaks = true}, RunContext{});
      ASSERT_TRUE(result.ok()) << path << ": " << result.status();
      EXPECT_GE(result->dressing.mesh.quads.size(), 200u) << path;
      EXPECT_EQ(result->dressing.tile.size(), result->dressing.mesh.quads.size());
      EXPECT_EQ(*FindBreaks(result->dressing, arrangement), result->breaks);
      const MeshInfo before = *DescribeMesh(*mesh);
      const MeshInfo after = *DescribeMesh(result->dressing.mesh);
      EXPECT_EQ(after.genus, before.genus) << path;
      EXPECT_EQ(after.num_boundary_loops, before.num_boundary_loops) << path;
      if (arrangement.turned_strips) {
        EXPECT_TRUE(result->breaks.empty()) << path;
      }
      // Ratios, as sizes are what subdivision is for.
      EXPECT_LE(after.max_area / after.min_area, before.max_area / before.min_area * 1.001) << path;
    }
  }
}

TEST(MeasuredMeshTest, GenusIsThatOfTheSource) {
  TESSERA_REQUIRE_DATA("meshes/quad/horse_quad.obj");
  const auto facts = [](const char* name) {
    const MeshInfo info = *DescribeMesh(*ReadQuadMesh(TestData("meshes/quad") / name));
    return std::pair(info.genus, info.num_boundary_loops);
  };
  EXPECT_EQ(facts("horse_quad.obj"), (std::pair<size_t, size_t>(0, 0)));
  EXPECT_EQ(facts("boxtoruscc2.off"), (std::pair<size_t, size_t>(1, 0)));
  EXPECT_EQ(facts("double-torus-quads.off"), (std::pair<size_t, size_t>(2, 0)));
  EXPECT_EQ(facts("six.off"), (std::pair<size_t, size_t>(0, 2)));
}

TEST(MeasuredMeshTest, TrianglesAndMixedMeshesAreRefused) {
  TESSERA_REQUIRE_DATA("meshes/tri");
  for (const std::filesystem::path& path : FilesIn(TestData("meshes/tri"))) {
    const auto mesh = ReadQuadMesh(path);
    EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(mesh.status().message()), testing::HasSubstr("face 1 (line ")) << path;
  }
}

}  // namespace
}  // namespace tessera
