#include "btf/remesh/remesh.h"

#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "btf/wang/mesh_topology.h"
#include "btf/wang/shapes.h"
#include "tests/btf/remesh/triangles.h"

namespace tessera {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;

// Angles and folds measured here, not by the code under test.
struct Measured {
  double mean_deviation_deg = 0.0;
  double worst_deviation_deg = 0.0;
  int folded = 0;
};

Measured Measure(const QuadMesh& mesh) {
  Measured measured;
  for (const Quad& quad : mesh.quads) {
    const auto p = [&](int k) -> Eigen::Vector3d { return mesh.positions[quad[k & 3]].cast<double>(); };
    const Eigen::Vector3d normal = (p(2) - p(0)).cross(p(3) - p(1));
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d next = p(k + 1) - p(k);
      const Eigen::Vector3d previous = p(k + 3) - p(k);
      const double angle = std::acos(next.dot(previous) / (next.norm() * previous.norm()));
      const double deviation = std::abs(angle * 180.0 / std::numbers::pi - 90.0);
      measured.mean_deviation_deg += deviation / (4.0 * static_cast<double>(mesh.quads.size()));
      measured.worst_deviation_deg = std::max(measured.worst_deviation_deg, deviation);
      measured.folded += !(next.cross(previous).dot(normal) > 0.0);
      measured.folded += !(mesh.normals[quad[k]].cast<double>().dot(normal) > 0.0);
    }
  }
  return measured;
}

TEST(RemeshTest, SolidsKeepTheirGenusAndGetSquareQuads) {
  for (const char* name : {"cube-sphere", "torus", "genus3"}) {
    const TriangleMesh mesh = Halved(*BuiltinShape(name));
    const auto result = RemeshTriangles(mesh, {.target_quads = 1500}, RunContext{});
    ASSERT_TRUE(result.ok()) << name << ": " << result.status();
    const RemeshReport& report = result->report;
    EXPECT_NEAR(static_cast<double>(result->mesh.quads.size()), 1500.0, 1500.0 * kQuadsTolerance) << name;
    EXPECT_EQ(report.num_quads, result->mesh.quads.size());
    EXPECT_TRUE(ValidateQuadMesh(result->mesh).ok());
    const auto info = DescribeMesh(result->mesh);
    ASSERT_TRUE(info.ok()) << info.status();
    EXPECT_EQ(info->num_boundary_edges, 0u);
    EXPECT_EQ(info->num_components, 1u);
    EXPECT_EQ(static_cast<int64_t>(info->genus), CheckClosedSurface(mesh)->genus) << name;
    EXPECT_EQ(report.topology_out, report.topology_in);
    const Measured measured = Measure(result->mesh);
    EXPECT_EQ(measured.folded, 0) << name;
    EXPECT_EQ(report.num_flipped, 0u);
    EXPECT_LT(measured.mean_deviation_deg, kMaxMeanAngleDeviationDeg) << name;
    EXPECT_LT(measured.worst_deviation_deg, 60.0) << name;
    // Positions are rounded to float32.
    EXPECT_NEAR(report.mean_angle_deviation_deg, measured.mean_deviation_deg, 1e-3);
    EXPECT_NEAR(report.worst_angle_deviation_deg, measured.worst_deviation_deg, 1e-2);
    EXPECT_LT(info->max_area / info->median_area, 6.0) << name;
    EXPECT_LT(info->median_area / info->min_area, 6.0) << name;
    // The height of a chord of 0.12 on a radius of 0.3 is 0.006, of a box with diagonal 3; quads may be
    // longer.
    EXPECT_LT(report.worst_distance, 0.012) << name;
    EXPECT_THAT(report.Warnings(), IsEmpty()) << name;
  }
}

TEST(RemeshTest, SameBytesForAnyNumberOfThreads) {
  const TriangleMesh mesh = Halved(*BuiltinShape("genus3"));
  const auto digest = [&](int num_threads) {
    RunContext context;
    context.num_threads = num_threads;
    const auto result = RemeshTriangles(mesh, {.target_quads = 700}, context);
    return result.ok() ? QuadMeshSha256(result->mesh) : std::string(result.status().message());
  };
  const std::string one = digest(1);
  EXPECT_EQ(one.size(), 64u);
  EXPECT_EQ(digest(2), one);
  EXPECT_EQ(digest(8), one);
}

TEST(RemeshTest, BoxesKeepTheirEdgesAndCorners) {
  const Eigen::Vector3f high(1.0f, 0.7f, 0.5f);
  const TriangleMesh mesh = Box({0.0f, 0.0f, 0.0f}, high);
  const auto result = RemeshTriangles(mesh, {.target_quads = 600}, RunContext{});
  ASSERT_TRUE(result.ok()) << result.status();
  int corners_kept = 0;
  for (const Eigen::Vector3f& corner : mesh.positions) {
    double closest = 1.0;
    for (const Eigen::Vector3f& p : result->mesh.positions) {
      closest = std::min<double>(closest, (p - corner).norm());
    }
    corners_kept += closest < 1e-6;
  }
  // All eight where possible; a vertex that would bend its quads too far stays off.
  EXPECT_GE(corners_kept, 7);
  // 8.8 units of edges, with sides of about 0.06.
  EXPECT_GT(result->report.num_on_creases, 100u);
  EXPECT_LT(result->report.worst_distance, 0.02);
  EXPECT_LT(result->report.mean_angle_deviation_deg, 5.0);
  EXPECT_EQ(Measure(result->mesh).folded, 0);
}

TEST(RemeshTest, AThinRimIsReachedAllAround) {
  // A lens, askew to the voxels.
  TriangleMesh lens = Halved(*BuiltinShape("cube-sphere"));
  const Eigen::Matrix3f turn =
      Eigen::AngleAxisf(0.6F, Eigen::Vector3f(0.36F, 0.48F, 0.8F)).toRotationMatrix();
  for (Eigen::Vector3f& p : lens.positions) {
    p = turn * p.cwiseProduct(Eigen::Vector3f(0.15F, 1.0F, 1.0F));
  }
  const auto result = RemeshTriangles(lens, {.target_quads = 1000}, RunContext{});
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->report.num_flipped, 0u);
  EXPECT_LT(result->report.worst_distance, 0.015);
}

TEST(RemeshTest, UnitsAndPlaceDoNotMatter) {
  TriangleMesh mesh = Halved(*BuiltinShape("torus"));
  const auto plain = RemeshTriangles(mesh, {.target_quads = 500}, RunContext{});
  for (Eigen::Vector3f& p : mesh.positions) {
    p *= 0x1p-40f;
  }
  const auto tiny = RemeshTriangles(mesh, {.target_quads = 500}, RunContext{});
  ASSERT_TRUE(plain.ok() && tiny.ok());
  EXPECT_EQ(tiny->mesh.quads, plain->mesh.quads);
  EXPECT_EQ(tiny->mesh.positions[7] * 0x1p40f, plain->mesh.positions[7]);
}

TEST(RemeshTest, RefusesWhatItCannotRemesh) {
  const auto error = [](const TriangleMesh& mesh, uint32_t target) {
    const absl::Status status = RemeshTriangles(mesh, {.target_quads = target}, RunContext{}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  TriangleMesh box = Box({0.0f, 0.0f, 0.0f}, {1.0f, 1.0f, 1.0f});
  EXPECT_THAT(error(box, 99), HasSubstr("a target of 99 quads, expected 100 to 1000000"));
  EXPECT_THAT(error(box, 1'000'001), HasSubstr("1000001"));
  EXPECT_THAT(error(Box({0.0f, 0.0f, 0.0f}, {1.0f, 1.0f, 0.0f}), 500), HasSubstr("no volume"));
  box.triangles.pop_back();
  EXPECT_THAT(error(box, 500), HasSubstr("not closed"));
}

TEST(RemeshTest, StopsWhenAsked) {
  std::stop_source source;
  RunContext context;
  context.stop = source.get_token();
  context.progress = [&](const Progress& progress) {
    if (progress.stage == "relax") {
      source.request_stop();
    }
  };
  const TriangleMesh mesh = Halved(*BuiltinShape("torus"));
  EXPECT_EQ(RemeshTriangles(mesh, {.target_quads = 500}, context).status().code(),
            absl::StatusCode::kCancelled);
}

TEST(RemeshReportTest, WarnsOfEachFigureBeyondItsLimit) {
  RemeshReport report{.num_quads = 1000, .target_quads = 1000, .topology_in = {1, 2}, .topology_out = {1, 2}};
  EXPECT_THAT(report.Warnings(), IsEmpty());
  report.topology_out.genus = 1;
  EXPECT_THAT(report.Warnings(), Contains(HasSubstr("of genus 2 became 1 of genus 1")));
  report.num_quads = 1200;
  EXPECT_THAT(report.Warnings(), Contains(HasSubstr("1200 quads instead of about 1000")));
  report.mean_angle_deviation_deg = 16.0;
  EXPECT_THAT(report.Warnings(),
              Contains(HasSubstr("mean deviation of corners from 90 degrees is 16; beyond 15")));
  report.worst_angle_deviation_deg = 80.0;
  report.worst_area_ratio = 9.0;
  report.worst_distance = 0.03;
  EXPECT_EQ(report.Warnings().size(), 6u);
}

}  // namespace
}  // namespace tessera
