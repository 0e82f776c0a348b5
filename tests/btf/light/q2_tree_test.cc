#include "btf/light/q2_tree.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/btf/light/environments.h"
#include "tests/btf/light/random_rotation.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

std::vector<EnvironmentLight> Lights(const Q2Tree& tree, int count) {
  auto lights = tree.Lights(count);
  EXPECT_TRUE(lights.ok()) << lights.status();
  return *std::move(lights);
}

// Relative root mean square error of the lights' irradiance over normals and channels.
class IrradianceError {
 public:
  explicit IrradianceError(const Environment& environment) {
    Rng rng(7);
    for (Eigen::Index i = 0; i < normals_.cols(); ++i) {
      normals_.col(i) = RandomDirection(rng);
    }
    for (int y = 0; y < environment.grid().height(); ++y) {
      for (int x = 0; x < environment.grid().width(); ++x) {
        const Eigen::Array3d power = environment.TexelRadiance(x, y) * environment.grid().SolidAngle(x, y);
        Add(environment.TexelDirection(x, y), power, &expected_);
      }
    }
  }

  [[nodiscard]] double Of(const std::vector<EnvironmentLight>& lights) const {
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(3, normals_.cols());
    for (const EnvironmentLight& light : lights) {
      Add(light.direction, light.irradiance, &sum);
    }
    return (sum - expected_).norm() / expected_.norm();
  }

 private:
  void Add(const Eigen::Vector3d& direction, const Eigen::Array3d& power, Eigen::MatrixXd* sum) const {
    *sum += power.matrix() * (direction.transpose() * normals_).cwiseMax(0.0);
  }

  Eigen::Matrix3Xd normals_ = Eigen::Matrix3Xd(3, 64);
  Eigen::MatrixXd expected_ = Eigen::MatrixXd::Zero(3, 64);
};

// The error at falling places of `counts`; the last must be below `bound`, and each below the one before.
void ExpectErrorFalls(const std::string& name, const Environment& environment, const std::vector<int>& counts,
                      double bound) {
  const IrradianceError error(environment);
  const Q2Tree tree(environment);
  double before = 1e300;
  for (const int count : counts) {
    const double now = error.Of(Lights(tree, count));
    EXPECT_LT(now, before) << name << ": " << count << " lights";
    testing::Test::RecordProperty(name + "_" + std::to_string(count), testing::PrintToString(now));
    before = now;
  }
  EXPECT_LT(before, bound) << name;
}

TEST(Q2TreeTest, QuadsAreOfEqualAreaAndNested) {
  // Points spread evenly (a golden spiral): each quad has its share of them, but for those at its border.
  constexpr int kPoints = 400000;
  for (const int level : {0, 1, 3}) {
    std::map<int64_t, int> counts;
    for (int i = 0; i < kPoints; ++i) {
      const double z = 1.0 - (2.0 * i + 1.0) / kPoints;
      const double phi = kPi * (3.0 - std::sqrt(5.0)) * i;
      const double across = std::sqrt(1.0 - z * z);
      const Eigen::Vector3d d(across * std::cos(phi), z, across * std::sin(phi));
      const int64_t quad = HealpixQuad(d, level);
      ++counts[quad];
      ASSERT_EQ(HealpixQuad(d, level + 1) >> 2, quad);
    }
    ASSERT_EQ(counts.size(), static_cast<size_t>(12 << (2 * level)));
    for (const auto& [quad, count] : counts) {
      EXPECT_NEAR(count * (12 << (2 * level)) / static_cast<double>(kPoints), 1.0, 0.03) << quad;
    }
  }
}

TEST(Q2TreeTest, QuadsAreWhereHealpixHasThem) {
  // Faces 0 and 8 begin at azimuth 45 degrees, face 4 at 0; the azimuth goes from +z to +x.
  const auto at = [](double elevation_deg, double azimuth_deg) {
    const double e = RadFromDeg(elevation_deg);
    const double a = RadFromDeg(azimuth_deg);
    return Eigen::Vector3d(std::cos(e) * std::sin(a), std::sin(e), std::cos(e) * std::cos(a));
  };
  for (int quarter = 0; quarter < 4; ++quarter) {
    EXPECT_EQ(HealpixQuad(at(41.8, 45 + 90 * quarter), 0), quarter);
    EXPECT_EQ(HealpixQuad(at(0, 90 * quarter), 0), 4 + quarter);
    EXPECT_EQ(HealpixQuad(at(-41.8, 45 + 90 * quarter), 0), 8 + quarter);
  }
  // A face's south corner is its first quad, its north corner the last.
  EXPECT_EQ(HealpixQuad(at(85, 45), 2), 15);
  EXPECT_EQ(HealpixQuad(at(2, 45), 2), 0);
  EXPECT_EQ(HealpixQuad(at(0, -30), 1) / 4, 4);
  for (const Eigen::Vector3d& d :
       {Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(-1e-300, 0, 1),
        Eigen::Vector3d(0, 0, -1), Eigen::Vector3d(-1e-17, 0.9, 0.4358898943540674)}) {
    const int64_t quad = HealpixQuad(d, 15);
    EXPECT_TRUE(quad >= 0 && quad < (int64_t{12} << 30)) << d.transpose();
  }
}

TEST(Q2TreeTest, AnyNumberOfLightsHoldsAllOfTheEnvironment) {
  // Of the whole: 131,072 texels' rounding.
  constexpr double kTolerance = 1e-12;
  for (const EnvironmentLayout layout : {EnvironmentLayout::kEquirect, EnvironmentLayout::kAngular}) {
    const Environment environment = EnvironmentOf(layout, 64, SunnySky, {.rotation_rad = 0.7, .scale = 3.0});
    const Q2Tree tree(environment);
    for (int count = 1; count <= 1000; count += count < 30 ? 1 : 97) {
      const std::vector<EnvironmentLight> lights = Lights(tree, count);
      ASSERT_EQ(lights.size(), static_cast<size_t>(count));
      Eigen::Array3d sum = Eigen::Array3d::Zero();
      double solid_angle = 0.0;
      for (const EnvironmentLight& light : lights) {
        sum += light.irradiance;
        solid_angle += light.solid_angle;
        ASSERT_NEAR(light.direction.norm(), 1.0, 1e-12);
      }
      EXPECT_LT((sum / environment.power() - 1.0).abs().maxCoeff(), kTolerance) << count;
      EXPECT_NEAR(solid_angle, 4.0 * kPi, 1e-11);
    }
  }
}

TEST(Q2TreeTest, ConstantLightIsSharedByArea) {
  const Environment environment = EnvironmentOf(
      EnvironmentLayout::kEquirect, 100, [](const Eigen::Vector3d&) { return Eigen::Array3d(1, 2, 3); });
  const Q2Tree tree(environment);
  for (const int count : {1, 12, 48, 192, 777}) {
    const std::vector<EnvironmentLight> lights = Lights(tree, count);
    Eigen::Array3d sum = Eigen::Array3d::Zero();
    for (const EnvironmentLight& light : lights) {
      EXPECT_LT((light.irradiance - Eigen::Array3d(1, 2, 3) * light.solid_angle).abs().maxCoeff(), 1e-12);
      sum += light.irradiance;
    }
    EXPECT_LT((sum - Eigen::Array3d(1, 2, 3) * 4.0 * kPi).abs().maxCoeff(), 1e-11);
    if (count == 12 || count == 48) {
      for (const EnvironmentLight& light : lights) {
        EXPECT_NEAR(light.solid_angle, 4.0 * kPi / count, 0.04 * 4.0 * kPi / count);
      }
    }
  }
  EXPECT_LT((Lights(tree, 1)[0].direction - Eigen::Vector3d(0, 1, 0)).norm(), 1e-12);
}

TEST(Q2TreeTest, DarkPartsGetNoLight) {
  // One lit texel is one light, however many are wanted of large texels' pieces.
  Image image(512, 256, 3);
  image.at(100, 60)[1] = 5.0F;
  const Environment environment = *Environment::Create(image, "lamp", {});
  const Q2Tree tree(environment);
  const std::vector<EnvironmentLight> lights = Lights(tree, 50);
  ASSERT_EQ(lights.size(), 1U);
  EXPECT_LT((lights[0].direction - environment.TexelDirection(100, 60)).norm(), 1e-12);
  EXPECT_TRUE(Lights(Q2Tree(*Environment::Create(Image(512, 256, 3), "night", {})), 50).empty());
  // A picture of a few texels still gives as many lights as wanted.
  EXPECT_EQ(Lights(Q2Tree(EnvironmentOf(EnvironmentLayout::kEquirect, 1, SunnySky)), 1000).size(), 1000U);
}

TEST(Q2TreeTest, SunsAreFoundFirst) {
  const Q2Tree tree(EnvironmentOf(EnvironmentLayout::kEquirect, 128, SunnySky));
  const EnvironmentLight brightest = Lights(tree, 40)[0];
  EXPECT_GT(brightest.direction.dot(Eigen::Vector3d(0.5, 0.6, -0.6).normalized()), 0.996);
}

TEST(Q2TreeTest, TurnsWithTheEnvironment) {
  const Environment plain = EnvironmentOf(EnvironmentLayout::kEquirect, 64, SunnySky);
  const Environment turned = EnvironmentOf(EnvironmentLayout::kEquirect, 64, SunnySky, {.rotation_rad = 1.0});
  const std::vector<EnvironmentLight> a = Lights(Q2Tree(plain), 100);
  const std::vector<EnvironmentLight> b = Lights(Q2Tree(turned), 100);
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_LT((turned.world_from_picture() * a[i].direction - b[i].direction).norm(), 1e-12);
    EXPECT_TRUE((a[i].irradiance == b[i].irradiance).all());
  }
}

TEST(Q2TreeTest, IsTheSameEveryTime) {
  const Environment environment = EnvironmentOf(EnvironmentLayout::kAngular, 96, SunnySky);
  const Q2Tree tree(environment);
  const std::vector<EnvironmentLight> a = Lights(tree, 300);
  Lights(tree, 17);
  const std::vector<EnvironmentLight> b = Lights(Q2Tree(environment), 300);
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_TRUE(a[i].direction == b[i].direction && (a[i].irradiance == b[i].irradiance).all());
  }
}

TEST(Q2TreeTest, RefusesCountsOutOfRange) {
  const Q2Tree tree(EnvironmentOf(EnvironmentLayout::kEquirect, 4, SunnySky));
  for (const int count : {0, -1, kMaxQ2Lights + 1}) {
    EXPECT_EQ(tree.Lights(count).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

TEST(Q2TreeTest, IrradianceErrorFallsWithTheNumberOfLights) {
  const std::vector<int> counts = {1, 10, 100, 1000};
  ExpectErrorFalls("sunny", EnvironmentOf(EnvironmentLayout::kEquirect, 128, SunnySky), counts, 0.0005);
  ExpectErrorFalls("constant",
                   EnvironmentOf(EnvironmentLayout::kEquirect, 128,
                                 [](const Eigen::Vector3d&) { return Eigen::Array3d::Ones(); }),
                   counts, 0.0005);
}

TEST(Q2TreeTest, IrradianceErrorFallsInMeasuredEnvironments) {
  TESSERA_REQUIRE_DATA("hdr/venice.hdr");
  for (const char* name : {"venice", "studio"}) {
    const auto environment = ReadEnvironment(TestData(std::string("hdr/") + name + ".hdr"), {});
    ASSERT_TRUE(environment.ok()) << environment.status();
    ExpectErrorFalls(name, *environment, {1, 10, 100, 1000}, 0.0005);
  }
}

}  // namespace
}  // namespace tessera
