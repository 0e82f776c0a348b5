// Remeshing the triangle meshes at hand.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/remesh/remesh.h"
#include "btf/remesh/triangle_mesh_io.h"
#include "btf/wang/mesh_topology.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

TEST(MeasuredRemeshTest, BunnyAndFriends) {
  TESSERA_REQUIRE_DATA("meshes/tri/bunny.off");
  struct Case {
    const char* name;
    uint32_t target;
    int64_t genus;
  };
  for (const Case& c : {Case{"bunny.off", 2000, 0}, Case{"bunny.off", 8000, 0}, Case{"3holes.off", 3000, 3},
                        Case{"torus.obj", 2000, 1}, Case{"spot.obj", 4000, 0}}) {
    const auto mesh = ReadTriangleMesh(TestData("meshes/tri") / c.name);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    const auto result = RemeshTriangles(*mesh, {.target_quads = c.target}, RunContext{});
    ASSERT_TRUE(result.ok()) << c.name << ": " << result.status();
    const RemeshReport& report = result->report;
    EXPECT_NEAR(static_cast<double>(report.num_quads), c.target, c.target * kQuadsTolerance) << c.name;
    EXPECT_EQ(report.num_flipped, 0u) << c.name;
    EXPECT_LT(report.mean_angle_deviation_deg, 15.0) << c.name;
    EXPECT_EQ(DescribeMesh(result->mesh)->genus, static_cast<size_t>(c.genus)) << c.name;
    EXPECT_EQ(report.topology_in.genus, c.genus) << c.name;
  }
}

TEST(MeasuredRemeshTest, AScanWithHolesIsRefusedByAnOpenEdge) {
  TESSERA_REQUIRE_DATA("meshes/tri/stanford-bunny-70k.obj");
  const auto mesh = ReadTriangleMesh(TestData("meshes/tri/stanford-bunny-70k.obj"));
  EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(mesh.status().message()),
              testing::HasSubstr("stanford-bunny-70k.obj: not closed: only triangle "));
}

}  // namespace
}  // namespace tessera
