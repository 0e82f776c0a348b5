#include "btf/wang/shapes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "btf/wang/mesh_topology.h"
#include "tests/btf/wang/meshes.h"

namespace tessera {
namespace {

// Volume enclosed by a closed mesh, positive when faces are counter-clockwise seen from outside.
double SignedVolume(const QuadMesh& mesh) {
  double volume = 0.0;
  for (const Quad& quad : mesh.quads) {
    const auto p = [&](int k) -> Eigen::Vector3d { return mesh.positions[quad[k]].cast<double>(); };
    volume += (p(0).dot(p(1).cross(p(2))) + p(0).dot(p(2).cross(p(3)))) / 6.0;
  }
  return volume;
}

TEST(BuiltinShapeTest, IsValidOrientedAndOfItsGenus) {
  const std::map<std::string_view, std::pair<size_t, size_t>> expected = {
      {"cube-sphere", {0, 0}}, {"genus3", {3, 0}}, {"plane", {0, 1}}, {"torus", {1, 0}}};
  ASSERT_EQ(BuiltinShapeNames().size(), expected.size());
  for (const std::string_view name : BuiltinShapeNames()) {
    const QuadMesh mesh = *BuiltinShape(name);
    const auto info = DescribeMesh(mesh);
    ASSERT_TRUE(info.ok()) << name << ": " << info.status();
    EXPECT_EQ(info->genus, expected.at(name).first) << name;
    EXPECT_EQ(info->num_boundary_loops, expected.at(name).second) << name;
    EXPECT_EQ(info->num_components, 1u) << name;
    EXPECT_EQ(info->num_vertices, mesh.positions.size()) << name;
    EXPECT_GE(mesh.quads.size(), 200u) << name;
    EXPECT_LE(mesh.quads.size(), 1500u) << name;
    EXPECT_LE(info->box_max.maxCoeff(), 1.001f) << name;
    EXPECT_GE(info->box_min.minCoeff(), -1.001f) << name;
    EXPECT_LE(info->max_edge / info->min_edge, 4.0) << name;
    if (name != "plane") {
      EXPECT_GT(SignedVolume(mesh), 0.0) << name << " shows its inside";
    }
    for (size_t face = 0; face < mesh.quads.size(); ++face) {
      for (int corner = 0; corner < 4; ++corner) {
        EXPECT_GT(WeightedCornerNormal(mesh, face, corner)
                      .dot(mesh.normals[mesh.quads[face][corner]].cast<double>()),
                  0.0)
            << name << ", face " << face;
      }
    }
  }
}

TEST(BuiltinShapeTest, LiesOnItsSurface) {
  const QuadMesh sphere = *BuiltinShape("cube-sphere");
  for (const Eigen::Vector3f& position : sphere.positions) {
    EXPECT_NEAR(position.norm(), 1.0, 1e-6);
  }
  const QuadMesh torus = *BuiltinShape("torus");
  for (const Eigen::Vector3f& position : torus.positions) {
    const double from_ring = std::hypot(std::hypot(position.x(), position.z()) - 0.7, position.y());
    EXPECT_NEAR(from_ring, 0.3, 1e-6);
  }
}

TEST(BuiltinShapeTest, Genus3IsSmoothAndThreefold) {
  const QuadMesh mesh = *BuiltinShape("genus3");
  // No crease: the tubes are eight quads around, so normals along an edge differ by 45 degrees on average.
  for (const Quad& quad : mesh.quads) {
    for (int k = 0; k < 4; ++k) {
      EXPECT_GT(mesh.normals[quad[k]].dot(mesh.normals[quad[(k + 1) % 4]]), 0.5f);
    }
  }
  // A turn by 120 degrees about z maps vertices to vertices, up to float32 rounding.
  const Eigen::AngleAxisf turn(2.0f * static_cast<float>(M_PI) / 3.0f, Eigen::Vector3f::UnitZ());
  for (const Eigen::Vector3f& position : mesh.positions) {
    const Eigen::Vector3f turned = turn * position;
    float nearest = 1e9f;
    for (const Eigen::Vector3f& other : mesh.positions) {
      nearest = std::min(nearest, (turned - other).norm());
    }
    EXPECT_LT(nearest, 1e-4f);
  }
}

TEST(BuiltinShapeTest, UnknownNamesAreAnswered) {
  const auto shape = BuiltinShape("klein-bottle");
  EXPECT_EQ(shape.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(shape.status().message()),
              testing::HasSubstr("'klein-bottle'; known: cube-sphere, genus3, plane, torus"));
}

}  // namespace
}  // namespace tessera
