// Encoding and decoding of "dsh-cls".
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/codec/dsh/dsh_decoder.h"
#include "btf/codec/dsh/dsh_encoder.h"
#include "btf/codec/quantize.h"
#include "btf/math/spherical_harmonics.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/support/codecs.h"
#include "tests/support/status.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

// The paper's method for one signal: the smallest lambda by bisection, one factorisation a step; lambda no
// smaller than the encoder's floor.
Eigen::VectorXd SlowCls(const Eigen::MatrixXd& basis, const Eigen::VectorXd& f, double solid_angle) {
  const double energy = solid_angle * f.squaredNorm() / static_cast<double>(f.size());
  const Eigen::MatrixXd a = basis.transpose() * basis;
  const auto solve = [&](double lambda) -> Eigen::VectorXd {
    return (a + lambda * Eigen::MatrixXd::Identity(a.rows(), a.cols())).ldlt().solve(basis.transpose() * f);
  };
  double low = 1e-6 * Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(a).eigenvalues().maxCoeff();
  double high = low;
  if (solve(low).squaredNorm() <= energy) {
    return solve(low);
  }
  while (solve(high).squaredNorm() > energy) {
    high *= 2.0;
  }
  for (int i = 0; i < 80; ++i) {
    const double middle = 0.5 * (low + high);
    (solve(middle).squaredNorm() > energy ? low : high) = middle;
  }
  return solve(high);
}

Eigen::MatrixXd Basis(const std::vector<Direction>& directions, int n) {
  Eigen::Matrix3Xd vectors(3, directions.size());
  for (size_t i = 0; i < directions.size(); ++i) {
    vectors.col(static_cast<Eigen::Index>(i)) = VectorFromDirection(directions[i]);
  }
  return ShMatrix(n, vectors);
}

TEST(DshEncodeTest, EqualsTheTwoPassesDoneSlowly) {
  SampledBtf btf = ShinyBtf(3, 2, RingDirections(4, 7), RingDirections(5, 8));
  for (const ClsEnergy energy : {ClsEnergy::kHemisphere, ClsEnergy::kSphere}) {
    const EncodeParams params{.kl = 16, .kv = 9, .cls_energy = energy};
    const auto material = Encode("dsh-cls", btf, params);
    ASSERT_TRUE(material.ok()) << material.status();
    const auto decoder = MakeDecoder(material->btfels);
    ASSERT_TRUE(decoder.ok()) << decoder.status();
    const double solid_angle = (energy == ClsEnergy::kHemisphere ? 2.0 : 4.0) * kPi;
    const Eigen::MatrixXd light_basis = Basis(btf.info().lights, params.kl);
    const Eigen::MatrixXd view_basis = Basis(btf.info().views, params.kv);
    const size_t num_views = btf.info().views.size();
    const size_t num_lights = btf.info().lights.size();
    for (int y = 0; y < 2; ++y) {
      for (int x = 0; x < 3; ++x) {
        std::vector<double> values(material->btfels.num_coefficients);
        (*decoder)->Dequantize(material->btfels.btfel(y * 3 + x), values);
        for (int channel = 0; channel < 3; ++channel) {
          Eigen::MatrixXd light_coefficients(params.kl, num_views);
          for (size_t v = 0; v < num_views; ++v) {
            Eigen::VectorXd f(num_lights);
            for (size_t l = 0; l < num_lights; ++l) {
              f[static_cast<Eigen::Index>(l)] = btf.at(x, y, channel, v, l);
            }
            light_coefficients.col(static_cast<Eigen::Index>(v)) = SlowCls(light_basis, f, solid_angle);
          }
          for (int i = 0; i < params.kl; ++i) {
            const Eigen::VectorXd expected =
                SlowCls(view_basis, light_coefficients.row(i).transpose(), solid_angle);
            for (int j = 0; j < params.kv; ++j) {
              const int index = (channel * params.kv + j) * params.kl + i;
              // Half a quantisation step, and the float arithmetic of the fast way.
              const double bound = (0.5 + kQuantizeRounding) * material->btfels.step[index] + 2e-3;
              EXPECT_NEAR(values[index], expected[j], bound)
                  << "channel " << channel << " j " << j << " i " << i;
            }
          }
        }
      }
    }
  }
}

TEST(DshEncodeTest, ReproducesASmoothBtf) {
  // A diffuse BTF, albedo 0.6 and flat: cos(theta_i) is band-limited, so the fit must meet it up to the
  // energy's estimate (kSphere leaves room) and half a step.
  SampledBtf btf(4, 4, RingDirections(5, 12), RingDirections(6, 16));
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        for (size_t v = 0; v < btf.info().views.size(); ++v) {
          for (size_t l = 0; l < btf.info().lights.size(); ++l) {
            btf.at(x, y, channel, v, l) =
                static_cast<float>(0.6 * std::cos(btf.info().lights[l].theta_rad) * (1 + x) / 4.0);
          }
        }
      }
    }
  }
  const auto material = Encode("dsh-cls", btf, {.kl = 9, .kv = 9, .cls_energy = ClsEnergy::kSphere});
  ASSERT_TRUE(material.ok()) << material.status();
  const auto decoder = MakeDecoder(material->btfels);
  ASSERT_TRUE(decoder.ok());
  for (const double theta_deg : {0.0, 20.0, 50.0, 70.0}) {
    const Eigen::Vector3d light = VectorFromDirection({RadFromDeg(theta_deg), 0.7});
    const Eigen::Vector3d view = VectorFromDirection({RadFromDeg(33.0), 2.0});
    const Eigen::Array3d rgb = (*decoder)->Decode(material->btfels.btfel(3), light, view, 0);
    EXPECT_NEAR(rgb[0], 0.6 * std::cos(RadFromDeg(theta_deg)), 0.01) << theta_deg;
  }
}

TEST(DshEncodeTest, DependsNeitherOnThreadsNorOnTheBudget) {
  SampledBtf btf = ShinyBtf(13, 9, RingDirections(3, 5), RingDirections(3, 6));
  const EncodeParams params{.kl = 9, .kv = 4};
  const auto reference = Encode("dsh-cls", btf, params, 1);
  ASSERT_TRUE(reference.ok());
  const std::string bytes = *SerializeMaterial(*reference);
  for (const int threads : {2, 8}) {
    EXPECT_EQ(*SerializeMaterial(*Encode("dsh-cls", btf, params, threads)), bytes) << threads << " threads";
  }
  // 9 rows of 13 x 108 floats are 50 kB: this budget spills, and holds two rows of samples and, twice, of
  // coefficients: those of one block are written while those of the next are found.
  EncodeParams small = params;
  small.memory_budget_bytes = 2 * (btf.SamplesPerRow() + 2 * 13 * 108) * sizeof(float);
  const auto spilled = Encode("dsh-cls", btf, small, 2);
  ASSERT_TRUE(spilled.ok()) << spilled.status();
  EXPECT_EQ(*SerializeMaterial(*spilled), bytes);
  SampledBtf again = ShinyBtf(13, 9, RingDirections(3, 5), RingDirections(3, 6));
  ASSERT_TRUE(Encode("dsh-cls", again, small, 2).ok());
  EXPECT_EQ(again.largest_request(), 2);
  small.memory_budget_bytes = 0;
  EXPECT_EQ(*SerializeMaterial(*Encode("dsh-cls", btf, small, 2)), bytes);
}

TEST(DshEncodeTest, NamesTheLegalCounts) {
  SampledBtf btf = ShinyBtf(1, 1, RingDirections(2, 3), RingDirections(2, 3));
  for (const int illegal : {0, -1, 24, 64}) {
    EXPECT_THAT(Message(Encode("dsh-cls", btf, {.kl = illegal}).status()),
                HasSubstr("1, 4, 9, 16, 25, 36 and 49"));
    EXPECT_THAT(Message(Encode("dsh-cls", btf, {.kv = illegal}).status()), HasSubstr("kv = "));
  }
}

TEST(DshEncodeTest, NamesTheSampleThatIsNotFinite) {
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                          -std::numeric_limits<float>::infinity(), 2e12F}) {
    SampledBtf btf = ShinyBtf(6, 5, RingDirections(3, 5), RingDirections(3, 6));
    btf.at(5, 3, 1, 4, 9) = bad;
    btf.at(0, 4, 0, 0, 0) = bad;  // later
    const auto material = Encode("dsh-cls", btf, {.kl = 4, .kv = 4});
    EXPECT_EQ(material.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(Message(material.status()), HasSubstr("view 4, light 9, texel (5, 3), channel 1"));
  }
}

TEST(DshEncodeTest, RefusesDirectionsBelowTheSurface) {
  SampledBtf btf = ShinyBtf(1, 1, {{0.0, 0.0}, {RadFromDeg(91.0), 0.0}}, RingDirections(2, 3));
  EXPECT_THAT(Message(Encode("dsh-cls", btf, {.kl = 1, .kv = 1}).status()), HasSubstr("views[1]"));
  SampledBtf none = ShinyBtf(1, 1, RingDirections(2, 3), {});
  EXPECT_THAT(Message(Encode("dsh-cls", none, {.kl = 1, .kv = 1}).status()), HasSubstr("no lights"));
}

TEST(DshEncodeTest, DegenerateBtfsStayFinite) {
  struct Case {
    const char* name;
    int width, height;
    std::vector<Direction> views, lights;
    float value;
  };
  const Case cases[] = {{"black", 4, 4, RingDirections(3, 5), RingDirections(3, 5), 0.0F},
                        {"constant", 4, 4, RingDirections(3, 5), RingDirections(3, 5), 0.5F},
                        {"one texel", 1, 1, RingDirections(3, 5), RingDirections(3, 5), 0.5F},
                        {"one column", 1, 7, RingDirections(3, 5), RingDirections(3, 5), 0.5F},
                        {"one row", 9, 1, RingDirections(3, 5), RingDirections(3, 5), 0.5F},
                        {"one direction", 2, 2, {{0.0, 0.0}}, {{0.4, 1.0}}, 0.5F},
                        {"grazing only", 2, 2, {{kPi / 2.0, 0.0}}, {{kPi / 2.0, 1.0}}, 0.5F},
                        {"huge", 2, 2, RingDirections(3, 5), RingDirections(3, 5), 1e12F},
                        {"tiny", 2, 2, RingDirections(3, 5), RingDirections(3, 5), 1e-38F},
                        {"negative", 2, 2, RingDirections(3, 5), RingDirections(3, 5), -1.0F}};
  for (const Case& c : cases) {
    SampledBtf btf(c.width, c.height, c.views, c.lights);
    for (int y = 0; y < c.height; ++y) {
      for (int x = 0; x < c.width; ++x) {
        for (int channel = 0; channel < 3; ++channel) {
          for (size_t v = 0; v < c.views.size(); ++v) {
            for (size_t l = 0; l < c.lights.size(); ++l) {
              btf.at(x, y, channel, v, l) = c.value;
            }
          }
        }
      }
    }
    const auto material = Encode("dsh-cls", btf, {.kl = 25, .kv = 25, .cls_energy = ClsEnergy::kSphere});
    ASSERT_TRUE(material.ok()) << c.name << ": " << material.status();
    const auto bytes = SerializeMaterial(*material);
    ASSERT_TRUE(bytes.ok()) << c.name << ": " << bytes.status();
    const auto decoder = MakeDecoder(material->btfels);
    ASSERT_TRUE(decoder.ok()) << c.name;
    const Eigen::Array3d rgb =
        (*decoder)->Decode(material->btfels.btfel(0), VectorFromDirection(c.lights.back()),
                           VectorFromDirection(c.views.back()), 0);
    EXPECT_TRUE(rgb.allFinite()) << c.name;
    EXPECT_GE(rgb.minCoeff(), 0.0) << c.name;
    if (std::string(c.name) == "black") {
      EXPECT_EQ(rgb.maxCoeff(), 0.0);
    }
    const auto small = Encode("dsh-cls", btf, {.kl = 9, .kv = 9});
    ASSERT_TRUE(small.ok()) << c.name << small.status();
    const auto embedding = FindCodec("dsh-cls")->Embed(*small, 4, RunContext{});
    ASSERT_TRUE(embedding.ok()) << c.name << embedding.status();
    for (const float value : embedding->values) {
      ASSERT_TRUE(std::isfinite(value)) << c.name;
    }
  }
}

TEST(DshEncodeTest, StopsWhenAsked) {
  SampledBtf btf = ShinyBtf(8, 8, RingDirections(3, 5), RingDirections(3, 5));
  std::stop_source stop;
  RunContext context;
  context.stop = stop.get_token();
  int reports = 0;
  context.progress = [&](const Progress& progress) {
    EXPECT_EQ(progress.total, 8U);
    if (++reports == 2) {
      stop.request_stop();
    }
  };
  const auto material =
      FindCodec("dsh-cls")->Encode(btf, {.kl = 4, .kv = 4, .memory_budget_bytes = 0}, context);
  EXPECT_EQ(material.status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(reports, 2);
}

TEST(QuantizeTest, ErrorIsBoundedByHalfAStep) {
  Rng rng(3);
  constexpr size_t kCount = 1000;
  const float scales[] = {1.0F, 1e-20F, 1e20F, 0.0F, 5e4F};
  std::vector<float> values;
  std::vector<float> minima(5, std::numeric_limits<float>::infinity());
  std::vector<float> maxima(5, -std::numeric_limits<float>::infinity());
  for (size_t n = 0; n < kCount; ++n) {
    for (int i = 0; i < 5; ++i) {
      const float v = scales[i] * static_cast<float>(rng.NextDouble() - 0.3) + (i == 3 ? 7.0F : 0.0F);
      values.push_back(v);
      minima[i] = std::min(minima[i], v);
      maxima[i] = std::max(maxima[i], v);
    }
  }
  const Quantisation q = UniformQuantisation(minima, maxima);
  std::vector<uint8_t> codes(values.size());
  Quantize(q, values, codes);
  std::vector<bool> used(256);
  for (size_t n = 0; n < values.size(); ++n) {
    const double decoded =
        static_cast<double>(q.offset[n % 5]) + static_cast<double>(q.step[n % 5]) * codes[n];
    EXPECT_LE(std::abs(decoded - values[n]), (0.5 + kQuantizeRounding) * q.step[n % 5]);
    used[codes[n]] = true;
  }
  EXPECT_TRUE(used[0] && used[255]);
}

// ----------------------------------------------------------------------------------------------------
// decoding

// A table with random codes, the directions reaching 75 degrees.
BtfelTable RandomTable(int kl, int kv) {
  SampledBtf btf = ShinyBtf(2, 2, RingDirections(4, 9), RingDirections(4, 9), 7);
  return Encode("dsh-cls", btf, {.kl = kl, .kv = kv})->btfels;
}

TEST(DshDecoderTest, IsTheDoubleSum) {
  const BtfelTable table = RandomTable(16, 9);
  const auto decoder = MakeDecoder(table);
  ASSERT_TRUE(decoder.ok());
  const Eigen::Vector3d light = VectorFromDirection({0.9, 4.0});
  const Eigen::Vector3d view = VectorFromDirection({0.3, 1.0});
  std::vector<double> yl(16);
  std::vector<double> yv(9);
  EvaluateSh(light, yl);
  EvaluateSh(view, yv);
  const Eigen::Array3d rgb = (*decoder)->Decode(table.btfel(2), light, view, 0);
  for (int channel = 0; channel < 3; ++channel) {
    double sum = 0.0;
    for (int j = 0; j < 9; ++j) {
      for (int i = 0; i < 16; ++i) {
        const int k = (channel * 9 + j) * 16 + i;
        sum += yl[i] * yv[j] * (double{table.offset[k]} + double{table.step[k]} * table.btfel(2)[k]);
      }
    }
    EXPECT_NEAR(rgb[channel], std::max(0.0, sum), 1e-12);
  }
}

TEST(DecoderTest, ManyTexelsAreEachTexel) {
  const BtfelTable table = RandomTable(25, 9);
  const auto decoder = MakeDecoder(table);
  ASSERT_TRUE(decoder.ok());
  const Eigen::Vector3d light = VectorFromDirection({1.4, 4.0});
  const Eigen::Vector3d view = VectorFromDirection({0.3, 1.0});
  for (int turns = 0; turns < 4; ++turns) {
    std::vector<float> rgb(table.size() * 3, -1.0F);
    (*decoder)->DecodeTexels(table.codes, light, view, turns, rgb);
    for (size_t texel = 0; texel < table.size(); ++texel) {
      const Eigen::Array3d one = (*decoder)->Decode(table.btfel(texel), light, view, turns);
      for (int channel = 0; channel < 3; ++channel) {
        EXPECT_NEAR(rgb[3 * texel + channel], one[channel], 2e-6) << texel << ' ' << channel;
      }
    }
  }
}

TEST(DshDecoderTest, NeverExtrapolates) {
  const BtfelTable table = RandomTable(25, 25);
  const auto decoder = DshDecoder::Create(table);
  ASSERT_TRUE(decoder.ok());
  const double limit = RadFromDeg(75.0);
  EXPECT_NEAR((*decoder)->max_light_theta_rad(), limit, 1e-9);
  std::vector<double> c(table.num_coefficients);
  (*decoder)->Dequantize(table.btfel(1), c);
  const auto evaluate = [&](const Direction& light, const Direction& view) {
    return (*decoder)->Evaluate(c, VectorFromDirection(light), VectorFromDirection(view));
  };
  const Direction inside{0.5, 2.0};
  for (const double theta_deg : {75.0, 80.0, 85.0, 89.9}) {
    const double theta = RadFromDeg(theta_deg);
    const Eigen::Array3d clamped_view = evaluate(inside, {theta, 5.0}) - evaluate(inside, {limit, 5.0});
    EXPECT_LT(clamped_view.abs().maxCoeff(), 1e-9);
    const Eigen::Array3d clamped_light =
        evaluate({theta, 5.0}, inside) - evaluate({limit, 5.0}, inside) * std::cos(theta) / std::cos(limit);
    EXPECT_LT(clamped_light.abs().maxCoeff(), 1e-9);
  }
  for (const double theta_deg : {90.0001, 120.0, 180.0}) {
    EXPECT_EQ(evaluate({RadFromDeg(theta_deg), 1.0}, inside).abs().maxCoeff(), 0.0);
    EXPECT_EQ(evaluate(inside, {RadFromDeg(theta_deg), 1.0}).abs().maxCoeff(), 0.0);
  }
  // Exactly on the horizon, and straight up.
  EXPECT_EQ((*decoder)->Evaluate(c, {1, 0, 0}, {0, 0, 1}).abs().maxCoeff(), 0.0);
  EXPECT_TRUE((*decoder)->Evaluate(c, {0, 0, 1}, {0, 0, 1}).allFinite());
}

TEST(DshDecoderTest, ATurnIsATurnOfBothDirections) {
  const BtfelTable table = RandomTable(16, 25);
  const auto decoder = MakeDecoder(table);
  ASSERT_TRUE(decoder.ok());
  // Lit from azimuth a, the texel turned counter-clockwise by 90 degrees looks as the unturned one lit from a
  // - 90.
  const double quarter = kPi / 2.0;
  for (int turns = 0; turns < 4; ++turns) {
    const Eigen::Array3d turned = (*decoder)->Decode(table.btfel(0), VectorFromDirection({0.6, 2.5}),
                                                     VectorFromDirection({0.4, 0.2}), turns);
    const Eigen::Array3d unturned =
        (*decoder)->Decode(table.btfel(0), VectorFromDirection({0.6, 2.5 - turns * quarter}),
                           VectorFromDirection({0.4, 0.2 - turns * quarter}), 0);
    EXPECT_LT((turned - unturned).abs().maxCoeff(), 1e-12);
  }
}

TEST(DshDecoderTest, MapsThroughTheBasisTables) {
  BtfelTable table = RandomTable(4, 4);
  const auto plain = MakeDecoder(table);
  // A basis that swaps functions 1 and 3 and doubles 2; coefficients changed the other way round decode the
  // same.
  CodecTable& basis = table.tables["basis_light"];
  basis.values.assign(16, 0.0F);
  basis.values[0 * 4 + 0] = 1.0F;
  basis.values[1 * 4 + 3] = 1.0F;
  basis.values[2 * 4 + 2] = 2.0F;
  basis.values[3 * 4 + 1] = 1.0F;
  const auto mapped = MakeDecoder(table);
  ASSERT_TRUE(mapped.ok()) << mapped.status();
  std::vector<double> c(48);
  (*plain)->Dequantize(table.btfel(0), c);
  std::vector<double> d = c;
  for (int row = 0; row < 12; ++row) {
    d[row * 4 + 1] = c[row * 4 + 3];
    d[row * 4 + 2] = c[row * 4 + 2] / 2.0;
    d[row * 4 + 3] = c[row * 4 + 1];
  }
  const Eigen::Vector3d light = VectorFromDirection({1.0, 1.0});
  const Eigen::Vector3d view = VectorFromDirection({0.2, 3.0});
  EXPECT_LT(((*plain)->Evaluate(c, light, view) - (*mapped)->Evaluate(d, light, view)).abs().maxCoeff(),
            1e-12);
}

TEST(DshDecoderTest, RefusesTablesThatDoNotFit) {
  const BtfelTable good = RandomTable(9, 4);
  ASSERT_TRUE(MakeDecoder(good).ok());
  BtfelTable table = good;
  table.codec_id = "jpeg-xl";
  EXPECT_EQ(MakeDecoder(table).status().code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(Message(MakeDecoder(table).status()), HasSubstr("jpeg-xl"));
  table = good;
  table.codec_version = 2;
  EXPECT_THAT(Message(MakeDecoder(table).status()), HasSubstr("version 2"));
  table = good;
  table.tables.erase("basis_view");
  EXPECT_THAT(Message(MakeDecoder(table).status()), HasSubstr("basis_view"));
  table = good;
  table.tables["basis_light"].shape = {3, 27};
  EXPECT_THAT(Message(MakeDecoder(table).status()), HasSubstr("basis_light"));
  table = good;
  table.parameters["kl"] = 4;
  EXPECT_THAT(Message(MakeDecoder(table).status()), HasSubstr("kl"));
  table = good;
  table.num_coefficients = 107;
  EXPECT_THAT(Message(MakeDecoder(table).status()), HasSubstr("107"));
  table = good;
  table.views.clear();
  EXPECT_THAT(Message(MakeDecoder(table).status()), HasSubstr("views"));
}

TEST(FindCodecTest, KnowsWhatItLists) {
  for (const std::string_view id : CodecIds()) {
    ASSERT_NE(FindCodec(id), nullptr);
    EXPECT_EQ(FindCodec(id)->id(), id);
  }
  EXPECT_EQ(FindCodec("nothing"), nullptr);
}

}  // namespace
}  // namespace tessera
