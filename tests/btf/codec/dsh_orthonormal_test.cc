// "dsh" and "dsh-ls": their bases and fits, against "dsh-cls".
#include <cmath>
#include <limits>
#include <string>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "btf/codec/codec.h"
#include "btf/codec/dsh/dsh_basis.h"
#include "btf/codec/dsh/dsh_decoder.h"
#include "btf/codec/quantize.h"
#include "btf/math/spherical_harmonics.h"
#include "tests/btf/codec/synthetic_btf.h"

namespace tessera {
namespace {

Material Encoded(std::string_view id, BtfSource& source, const EncodeParams& params) {
  auto material = FindCodec(id)->Encode(source, params, {});
  EXPECT_TRUE(material.ok()) << material.status();
  return *std::move(material);
}

// Over all samples, as decoded from the codes.
double Rmse(SampledBtf& btf, const Material& material) {
  const auto decoder = *MakeDecoder(material.btfels);
  const BtfInfo& info = btf.info();
  double sum = 0.0;
  size_t count = 0;
  std::vector<float> rgb(material.btfels.size() * 3);
  for (size_t v = 0; v < info.views.size(); ++v) {
    for (size_t l = 0; l < info.lights.size(); ++l) {
      decoder->DecodeTexels(material.btfels.codes, VectorFromDirection(info.lights[l]),
                            VectorFromDirection(info.views[v]), 0, rgb);
      for (size_t i = 0; i < rgb.size(); ++i, ++count) {
        const int texel = static_cast<int>(i / 3);
        const double difference =
            rgb[i] - btf.at(texel % info.width, texel / info.width, static_cast<int>(i % 3), v, l);
        sum += difference * difference;
      }
    }
  }
  return std::sqrt(sum / static_cast<double>(count));
}

// The midpoint rule, fine enough for the tolerance below whatever bends at the largest polar angle.
template <typename Weights>
Eigen::MatrixXd SlowGram(int n, const Weights& weights) {
  constexpr int kPolar = 4000;
  constexpr int kAzimuths = 16;  // more than twice the degree: exact
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd y(n);
  for (int i = 0; i < kPolar; ++i) {
    const double z = (i + 0.5) / kPolar;
    for (int j = 0; j < kAzimuths; ++j) {
      const double phi = 2.0 * kPi * (j + 0.3) / kAzimuths;
      const double r = std::sqrt(1.0 - z * z);
      weights(Eigen::Vector3d(r * std::cos(phi), r * std::sin(phi), z), std::span(y.data(), y.size()));
      gram += y * y.transpose() * (2.0 * kPi / kPolar / kAzimuths);
    }
  }
  return gram;
}

TEST(DshBasisTest, IsOrthonormalOverTheHemisphereAsDecoded) {
  for (const double max_theta_deg : {75.0, 90.0, 60.0}) {
    SampledBtf btf =
        ShinyBtf(2, 1, RingDirections(7, 12, max_theta_deg), RingDirections(6, 14, max_theta_deg));
    const Material material = Encoded("dsh", btf, {.kl = 25, .kv = 16});
    const auto decoder = DshDecoder::Create(material.btfels);
    ASSERT_TRUE(decoder.ok()) << decoder.status();
    const Eigen::MatrixXd light =
        SlowGram(25, [&](const Eigen::Vector3d& d, std::span<double> y) { (*decoder)->LightWeights(d, y); });
    const Eigen::MatrixXd view =
        SlowGram(16, [&](const Eigen::Vector3d& d, std::span<double> y) { (*decoder)->ViewWeights(d, y); });
    // Tables are float32, and their entries cancel: so much of the largest may be left.
    constexpr double kRounding = 20.0 / (1 << 24);
    const double tolerance = kRounding * (*decoder)->basis_light().cwiseAbs().maxCoeff() + 1e-5;
    EXPECT_LT(tolerance, 0.02);
    EXPECT_LT((light - Eigen::MatrixXd::Identity(25, 25)).cwiseAbs().maxCoeff(), tolerance) << max_theta_deg;
    EXPECT_LT((view - Eigen::MatrixXd::Identity(16, 16)).cwiseAbs().maxCoeff(), tolerance) << max_theta_deg;
  }
}

TEST(DshBasisTest, TurnsAsTheHarmonicsDo) {
  const Eigen::MatrixXd basis = OrthonormalDshBasis(49, DshArgument::kLight, RadFromDeg(75.0));
  const ShQuarterTurns turn = MakeShQuarterTurns(1);
  for (int i = 0; i < 49; ++i) {
    for (int j = 0; j < 49; ++j) {
      EXPECT_EQ(turn.sign[i] * basis(turn.source[i], turn.source[j]), turn.sign[j] * basis(i, j));
    }
  }
}

TEST(DshBasisTest, StaysFiniteWhereFunctionsCannotBeToldApart) {
  for (const double max_theta_deg : {0.0, 1e-3, 5.0, 20.0, 90.0}) {
    for (const DshArgument argument : {DshArgument::kLight, DshArgument::kView}) {
      const Eigen::MatrixXd basis = OrthonormalDshBasis(49, argument, RadFromDeg(max_theta_deg));
      EXPECT_TRUE(basis.allFinite());
      EXPECT_LT(basis.cwiseAbs().maxCoeff(), 1.1 / std::sqrt(kDshGramFloor)) << max_theta_deg;
    }
  }
}

TEST(DshBasisTest, ThePenaltyIsSizeAndRoughness) {
  const double limit = RadFromDeg(75.0);
  const Eigen::MatrixXd basis = OrthonormalDshBasis(16, DshArgument::kView, limit);
  const Eigen::MatrixXd penalty = DshPenalty(basis);
  // One function with all degrees in it; its Laplacian by differences of second order along two great circles
  // through each point of a midpoint rule.
  Eigen::VectorXd c(16);
  for (int i = 0; i < 16; ++i) {
    c[i] = std::cos(1.7 * i);
  }
  const Eigen::VectorXd plain = basis.transpose() * c;
  const auto value = [&](const Eigen::Vector3d& d) {
    Eigen::VectorXd y(16);
    EvaluateSh(d.normalized(), std::span(y.data(), 16));
    return y.dot(plain);
  };
  constexpr int kPolar = 60;
  constexpr int kAzimuths = 24;
  constexpr double kStep = 1e-3;
  double roughness = 0.0;
  for (int i = 0; i < kPolar; ++i) {
    for (int j = 0; j < kAzimuths; ++j) {
      const Eigen::Vector3d d =
          VectorFromDirection({std::acos((i + 0.5) / kPolar), 2.0 * kPi * j / kAzimuths});
      const Eigen::Vector3d u = d.unitOrthogonal();
      const Eigen::Vector3d v = d.cross(u);
      double laplacian = -4.0 * value(d);
      for (const Eigen::Vector3d& tangent : {u, v}) {
        laplacian += value(std::cos(kStep) * d + std::sin(kStep) * tangent) +
                     value(std::cos(kStep) * d - std::sin(kStep) * tangent);
      }
      laplacian /= kStep * kStep;
      roughness += laplacian * laplacian * 2.0 * kPi / (kPolar * kAzimuths);
    }
  }
  EXPECT_NEAR(c.dot(penalty * c), c.squaredNorm() + kDshRoughness * roughness, 5e-3 * c.dot(penalty * c));
}

TEST(DshOrthonormalTest, EqualsTheTwoPassesDoneSlowly) {
  SampledBtf btf = ShinyBtf(3, 2, RingDirections(4, 9), RingDirections(5, 9));
  const Material material = Encoded("dsh", btf, {.kl = 16, .kv = 9});
  const BtfelTable& table = material.btfels;
  const auto decoder = *DshDecoder::Create(table);
  const auto samples = [](const std::vector<Direction>& directions, const Eigen::MatrixXd& basis) {
    Eigen::Matrix3Xd vectors(3, directions.size());
    for (size_t i = 0; i < directions.size(); ++i) {
      vectors.col(static_cast<Eigen::Index>(i)) = VectorFromDirection(directions[i]);
    }
    return Eigen::MatrixXd(ShMatrix(static_cast<int>(basis.rows()), vectors) * basis.transpose());
  };
  const auto solve = [](const Eigen::MatrixXd& y, const Eigen::MatrixXd& penalty,
                        const Eigen::MatrixXd& f) -> Eigen::MatrixXd {
    return (y.transpose() * y + penalty).ldlt().solve(y.transpose() * f);
  };
  const Eigen::MatrixXd yl = samples(table.lights, decoder->basis_light());
  const Eigen::MatrixXd yv = samples(table.views, decoder->basis_view());
  const double light_ridge = table.parameters["ridge_light"];
  const double view_ridge = table.parameters["ridge_view"];
  EXPECT_GT(light_ridge, 0.0);
  EXPECT_GT(view_ridge, 0.0);
  const Eigen::MatrixXd light_penalty = light_ridge * DshPenalty(decoder->basis_light());
  const Eigen::MatrixXd view_penalty = view_ridge * DshPenalty(decoder->basis_view());
  std::vector<double> values(table.num_coefficients);
  for (int texel = 0; texel < 6; ++texel) {
    decoder->Dequantize(table.btfel(texel), values);
    for (int channel = 0; channel < 3; ++channel) {
      Eigen::MatrixXd f(table.lights.size(), table.views.size());
      for (Eigen::Index v = 0; v < f.cols(); ++v) {
        for (Eigen::Index l = 0; l < f.rows(); ++l) {
          f(l, v) = btf.at(texel % 3, texel / 3, channel, v, l);
        }
      }
      const Eigen::MatrixXd c =
          solve(yv, view_penalty, solve(yl, light_penalty, f).transpose()).transpose();  // [kl][kv]
      for (int j = 0; j < 9; ++j) {
        for (int i = 0; i < 16; ++i) {
          const int index = (channel * 9 + j) * 16 + i;
          EXPECT_NEAR(values[index], c(i, j), (0.5 + kQuantizeRounding) * table.step[index] + 1e-5) << index;
        }
      }
    }
  }
}

TEST(DshOrthonormalTest, BeatsTheOthersAtTheSameBytes) {
  SampledBtf btf = ShinyBtf(8, 8, RingDirections(6, 16), RingDirections(6, 16));
  for (const int k : {9, 25, 49}) {
    const EncodeParams params{.kl = k, .kv = k};
    const Material dsh = Encoded("dsh", btf, params);
    const Material cls = Encoded("dsh-cls", btf, params);
    const Material ls = Encoded("dsh-ls", btf, params);
    EXPECT_EQ(dsh.btfels.codes.size(), cls.btfels.codes.size());
    const double error = Rmse(btf, dsh);
    EXPECT_LT(error, 0.9 * Rmse(btf, cls)) << k;
    if (k == 25) {
      EXPECT_GT(Rmse(btf, ls), 10.0 * error) << "it is kept to show this";
    }
  }
}

TEST(DshLeastSquaresTest, IsThePseudoInverseWithinASteps) {
  SampledBtf btf = ShinyBtf(2, 2, RingDirections(5, 12), RingDirections(5, 12));
  const Material material = Encoded("dsh-ls", btf, {.kl = 9, .kv = 9});
  const BtfelTable& table = material.btfels;
  Eigen::Matrix3Xd vectors(3, table.lights.size());
  for (size_t i = 0; i < table.lights.size(); ++i) {
    vectors.col(static_cast<Eigen::Index>(i)) = VectorFromDirection(table.lights[i]);
  }
  const Eigen::MatrixXd inverse =
      Eigen::MatrixXd(ShMatrix(9, vectors)).completeOrthogonalDecomposition().pseudoInverse();
  const auto decoder = *MakeDecoder(table);
  std::vector<double> values(table.num_coefficients);
  decoder->Dequantize(table.btfel(3), values);
  Eigen::MatrixXd f(table.lights.size(), table.views.size());
  for (Eigen::Index v = 0; v < f.cols(); ++v) {
    for (Eigen::Index l = 0; l < f.rows(); ++l) {
      f(l, v) = btf.at(1, 1, 2, v, l);
    }
  }
  const Eigen::MatrixXd c = inverse * f * inverse.transpose();  // the same directions on both sides
  for (int j = 0; j < 9; ++j) {
    for (int i = 0; i < 9; ++i) {
      const int index = (2 * 9 + j) * 9 + i;
      EXPECT_NEAR(values[index], c(i, j), (0.5 + kQuantizeRounding) * table.step[index] + 1e-4) << index;
    }
  }
}

TEST(DshFamilyTest, DegenerateBtfsStayFinite) {
  struct Case {
    const char* name;
    int width, height;
    std::vector<Direction> views, lights;
    float value;
  };
  const Case cases[] = {{"black", 4, 4, RingDirections(3, 5), RingDirections(3, 5), 0.0F},
                        {"one texel", 1, 1, RingDirections(3, 5), RingDirections(3, 5), 0.5F},
                        {"one column", 1, 7, RingDirections(3, 5), RingDirections(3, 5), 0.5F},
                        {"one direction", 2, 2, {{0.0, 0.0}}, {{0.4, 1.0}}, 0.5F},
                        {"normal only", 2, 2, {{0.0, 0.0}}, {{0.0, 1.0}}, 0.5F},
                        {"grazing only", 2, 2, {{kPi / 2.0, 0.0}}, {{kPi / 2.0, 1.0}}, 0.5F},
                        {"huge", 2, 2, RingDirections(3, 5), RingDirections(3, 5), 1e12F},
                        {"tiny", 2, 2, RingDirections(3, 5), RingDirections(3, 5), 1e-38F},
                        {"negative", 2, 2, RingDirections(3, 5), RingDirections(3, 5), -1.0F}};
  for (const char* const id : {"dsh", "dsh-ls"}) {
    for (const Case& c : cases) {
      SampledBtf btf(c.width, c.height, c.views, c.lights);
      for (int texel = 0; texel < c.width * c.height; ++texel) {
        for (int channel = 0; channel < 3; ++channel) {
          for (size_t pair = 0; pair < c.views.size() * c.lights.size(); ++pair) {
            btf.at(texel % c.width, texel / c.width, channel, pair / c.lights.size(),
                   pair % c.lights.size()) = c.value;
          }
        }
      }
      const Material material = Encoded(id, btf, {.kl = 49, .kv = 25});
      ASSERT_TRUE(SerializeMaterial(material).ok()) << id << ' ' << c.name;
      const double rmse = Rmse(btf, material);
      const double bound = std::string(id) == "dsh-ls"             ? std::numeric_limits<double>::infinity()
                           : c.value < 0.0F                        ? 1.001  // clamped to 0
                           : std::string(c.name) == "grazing only" ? 0.501  // black on the horizon
                                                                   : 0.05 * c.value;
      EXPECT_TRUE(std::isfinite(rmse)) << id << ' ' << c.name;
      EXPECT_LE(rmse, bound) << id << ' ' << c.name;
      const auto embedding = FindCodec(id)->Embed(Encoded(id, btf, {.kl = 9, .kv = 9}), 4, {});
      ASSERT_TRUE(embedding.ok()) << id << ' ' << c.name << embedding.status();
      for (const float value : embedding->values) {
        ASSERT_TRUE(std::isfinite(value)) << id << ' ' << c.name;
      }
    }
  }
}

TEST(DshFamilyTest, DependsNeitherOnThreadsNorOnTheBudget) {
  for (const char* const id : {"dsh", "dsh-ls"}) {
    SampledBtf btf = ShinyBtf(13, 9, RingDirections(3, 5), RingDirections(3, 6));
    RunContext context;
    context.num_threads = 1;
    EncodeParams params{.kl = 9, .kv = 4};
    const std::string bytes = *SerializeMaterial(*FindCodec(id)->Encode(btf, params, context));
    context.num_threads = 8;
    EXPECT_EQ(*SerializeMaterial(*FindCodec(id)->Encode(btf, params, context)), bytes) << id;
    params.memory_budget_bytes = 0;
    EXPECT_EQ(*SerializeMaterial(*FindCodec(id)->Encode(btf, params, context)), bytes) << id;
  }
}

TEST(DshFamilyTest, NamesTheSampleThatIsNotFinite) {
  for (const char* const id : {"dsh", "dsh-ls"}) {
    SampledBtf btf = ShinyBtf(6, 5, RingDirections(3, 5), RingDirections(3, 6));
    btf.at(5, 3, 1, 4, 9) = std::numeric_limits<float>::quiet_NaN();
    const auto material = FindCodec(id)->Encode(btf, {.kl = 4, .kv = 4}, {});
    EXPECT_EQ(material.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_NE(std::string(material.status().message()).find("view 4, light 9, texel (5, 3), channel 1"),
              std::string::npos)
        << material.status();
  }
}

}  // namespace
}  // namespace tessera
