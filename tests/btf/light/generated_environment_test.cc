#include "btf/light/generated_environment.h"

#include <gtest/gtest.h>

#include "tests/btf/light/environments.h"

namespace tessera {
namespace {

TEST(GeneratedEnvironmentTest, HaveTheirNamesPowerAndPeak) {
  for (const std::string& name : GeneratedEnvironmentNames()) {
    const auto environment = GeneratedEnvironment(name);
    ASSERT_TRUE(environment.ok()) << environment.status();
    EXPECT_GT(environment->MeanRadiance().minCoeff(), 0.3) << name;
    EXPECT_LT(environment->MeanRadiance().maxCoeff(), 2.0) << name;
  }
  EXPECT_EQ(GeneratedEnvironment("night").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ReducedEnvironmentTest, KeepsPowerWhereTexelsFallWhole) {
  const Environment fine =
      EnvironmentOf(EnvironmentLayout::kEquirect, 64, SunnySky, {.rotation_rad = 0.4, .scale = 2.0});
  const Environment coarse = Reduced(fine, 16);
  EXPECT_EQ(coarse.grid().width(), 32);
  EXPECT_LT((coarse.power() / fine.power() - 1.0).abs().maxCoeff(), 1e-6);
  EXPECT_EQ(coarse.world_from_picture(), fine.world_from_picture());
  // The same picture is left alone, but for rounding; a larger one is interpolated.
  const Environment same = Reduced(coarse, 16);
  EXPECT_LT((same.TexelRadiance(3, 5) - coarse.TexelRadiance(3, 5)).abs().maxCoeff(), 1e-5);
  const Environment larger = Reduced(coarse, 40);
  EXPECT_LT((larger.power() / fine.power() - 1.0).abs().maxCoeff(), 0.05);
}

TEST(ReducedEnvironmentTest, TakesAngularMaps) {
  const Environment probe = EnvironmentOf(EnvironmentLayout::kAngular, 96, [](const Eigen::Vector3d& d) {
    return Eigen::Array3d(1.0 + d.x(), 1.0 + d.y(), 1.0 + d.z());
  });
  const Environment reduced = Reduced(probe, 16);
  EXPECT_LT((reduced.power() / probe.power() - 1.0).abs().maxCoeff(), 0.01);
  for (const auto& [x, y] : {std::pair(3, 4), std::pair(20, 12)}) {
    const Eigen::Vector3d d = reduced.TexelDirection(x, y);
    EXPECT_LT((reduced.TexelRadiance(x, y) - (Eigen::Array3d(d) + 1.0)).abs().maxCoeff(), 0.1);
  }
}

}  // namespace
}  // namespace tessera
