// The codec "dfmf": encoding against a full decomposition, and decoding.
#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/SVD>

#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/codec/dfmf/dfmf_decoder.h"
#include "btf/codec/material.h"
#include "btf/data/direction_sets.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/support/codecs.h"
#include "tests/support/status.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

SampledBtf Shiny(int width, int height, uint64_t seed = 1) {
  return ShinyBtf(width, height, RingDirections(4, 9), RingDirections(4, 8), seed);
}

// RMSE of the decoded values at the measured directions.
double Rmse(SampledBtf& btf, const Material& material) {
  const auto decoder = MakeDecoder(material.btfels);
  EXPECT_TRUE(decoder.ok()) << decoder.status();
  const BtfInfo& info = btf.info();
  std::vector<float> rgb(3 * material.btfels.size());
  double sum = 0.0;
  for (size_t v = 0; v < info.views.size(); ++v) {
    for (size_t l = 0; l < info.lights.size(); ++l) {
      (*decoder)->DecodeTexels(material.btfels.codes, VectorFromDirection(info.lights[l]),
                               VectorFromDirection(info.views[v]), 0, rgb);
      for (int n = 0; n < info.width * info.height; ++n) {
        for (int channel = 0; channel < 3; ++channel) {
          const double d = rgb[3 * n + channel] - btf.at(n % info.width, n / info.width, channel, v, l);
          sum += d * d;
        }
      }
    }
  }
  return std::sqrt(sum / (3.0 * info.width * info.height * info.views.size() * info.lights.size()));
}

// That of the best approximation by `rank` components of luminance and chrominance apart, in any axes of
// colour: below it nothing can be.
double BestRmse(SampledBtf& btf, int rank) {
  const BtfInfo& info = btf.info();
  const int pairs = static_cast<int>(info.views.size() * info.lights.size());
  const int texels = info.width * info.height;
  Eigen::MatrixXd a(3 * pairs, texels);
  for (int n = 0; n < texels; ++n) {
    for (int i = 0; i < 3 * pairs; ++i) {
      const int l = i % static_cast<int>(info.lights.size());
      const int v = i / static_cast<int>(info.lights.size()) % static_cast<int>(info.views.size());
      a(i, n) = btf.at(n % info.width, n / info.width, i / pairs, v, l);
    }
  }
  const Eigen::VectorXd values = Eigen::BDCSVD<Eigen::MatrixXd>(a).singularValues();
  return std::sqrt(values.tail(std::max<Eigen::Index>(0, values.size() - rank)).squaredNorm() /
                   static_cast<double>(a.size()));
}

// Eight-bit coefficients and resampled factors add this much of the samples' root mean square, about 0.4.
constexpr double kStorageError = 0.006;

TEST(DfmfEncodeTest, ErrorFallsWithRankTowardsTheBest) {
  SampledBtf btf = Shiny(12, 10);
  double previous = 1.0;
  for (const int rank : {1, 3, 8, 24}) {
    const auto material = Encode("dfmf", btf, {.rank = rank});
    ASSERT_TRUE(material.ok()) << material.status();
    EXPECT_EQ(material->btfels.num_coefficients, rank);
    const double rmse = Rmse(btf, *material);
    const double best = BestRmse(btf, rank);
    EXPECT_LT(rmse, previous) << rank;
    EXPECT_GE(rmse, 0.99 * best) << rank;
    // Components of luminance and chrominance apart need more of them than joined ones.
    EXPECT_LE(rmse, 2.0 * best + kStorageError) << rank;
    // The clamp at 0 can only help.
    const double predicted = material->metadata["encode_rmse"].get<double>();
    EXPECT_LE(rmse, 1.02 * predicted) << rank;
    EXPECT_GE(rmse, 0.8 * predicted) << rank;
    previous = rmse;
  }
}

TEST(DfmfEncodeTest, RanksAtAndBeyondTheNumericalOne) {
  // Three kinds of texels: rank 3, and grey, so no chrominance at all.
  SampledBtf kinds = Shiny(3, 1, 5);
  SampledBtf btf(9, 5, kinds.info().views, kinds.info().lights);
  for (int n = 0; n < 45; ++n) {
    for (size_t v = 0; v < btf.info().views.size(); ++v) {
      for (size_t l = 0; l < btf.info().lights.size(); ++l) {
        for (int channel = 0; channel < 3; ++channel) {
          btf.at(n % 9, n / 9, channel, v, l) = kinds.at((n * 7 + n / 9) % 3, 0, 0, v, l);
        }
      }
    }
  }
  for (const int rank : {3, 4, 40, 200}) {
    const auto material = Encode("dfmf", btf, {.rank = rank});
    ASSERT_TRUE(material.ok()) << material.status();
    EXPECT_EQ(material->btfels.num_coefficients, 3) << rank;
    EXPECT_LT(Rmse(btf, *material), kStorageError);
  }
}

TEST(DfmfEncodeTest, MeetsAnErrorBound) {
  SampledBtf btf = Shiny(12, 10);
  size_t previous = 0;
  for (const double bound : {0.05, 0.02, 0.01}) {
    const auto material = Encode("dfmf", btf, {.max_error = bound});
    ASSERT_TRUE(material.ok()) << material.status();
    EXPECT_LE(Rmse(btf, *material), bound);
    const size_t bytes = SerializeMaterial(*material)->size();
    EXPECT_GT(bytes, previous);
    previous = bytes;
  }
  const auto material = Encode("dfmf", btf, {.max_error = 1e-9});
  EXPECT_EQ(material.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(Message(material.status()), HasSubstr("RMSE of"));
}

TEST(DfmfEncodeTest, FitsIntoBytes) {
  SampledBtf btf = Shiny(24, 20);
  double previous = 1.0;
  for (const uint64_t bound : {20'000, 40'000, 80'000}) {
    const auto material = Encode("dfmf", btf, {.max_bytes = bound});
    ASSERT_TRUE(material.ok()) << material.status();
    const size_t bytes = SerializeMaterial(*material)->size();
    EXPECT_LE(bytes, bound);
    EXPECT_GE(bytes, bound / 2);
    const double rmse = Rmse(btf, *material);
    EXPECT_LT(rmse, previous);
    previous = rmse;
  }
  const auto material = Encode("dfmf", btf, {.max_bytes = 1000});
  EXPECT_EQ(material.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(Message(material.status()), HasSubstr("max_bytes = 1000"));
}

TEST(DfmfEncodeTest, AnyNumberOfThreadsGivesTheSameBytes) {
  SampledBtf btf = Shiny(21, 9);
  const std::string one = *SerializeMaterial(*Encode("dfmf", btf, {.rank = 12}, 1));
  for (const int threads : {2, 8}) {
    EXPECT_EQ(*SerializeMaterial(*Encode("dfmf", btf, {.rank = 12}, threads)), one) << threads;
  }
}

TEST(DfmfEncodeTest, HonoursTheBudget) {
  SampledBtf btf = Shiny(16, 16);
  const auto roomy = Encode("dfmf", btf, {.rank = 10});
  ASSERT_TRUE(roomy.ok());
  EXPECT_EQ(btf.largest_request(), 16);
  SampledBtf again = Shiny(16, 16);
  const uint64_t row_bytes = again.SamplesPerRow() * sizeof(float);
  const auto tight = Encode("dfmf", again, {.rank = 10, .memory_budget_bytes = 8 * row_bytes});
  ASSERT_TRUE(tight.ok()) << tight.status();
  EXPECT_EQ(again.largest_request(), 2);  // a quarter
  EXPECT_EQ(*SerializeMaterial(*tight), *SerializeMaterial(*roomy));
  SampledBtf least = Shiny(16, 16);
  const auto spilled = Encode("dfmf", least, {.rank = 10, .memory_budget_bytes = 1});
  ASSERT_TRUE(spilled.ok()) << spilled.status();
  EXPECT_EQ(least.largest_request(), 1);
  EXPECT_EQ(*SerializeMaterial(*spilled), *SerializeMaterial(*roomy));
}

TEST(DfmfEncodeTest, DegenerateTexturesAndSets) {
  const std::vector<Direction> one = {{0.3, 1.0}};
  struct Case {
    const char* name;
    int width, height;
    std::vector<Direction> views, lights;
    float value;  // negative: shiny
  };
  const Case cases[] = {{"black", 4, 3, RingDirections(3, 5), RingDirections(3, 5), 0.0F},
                        {"constant", 4, 3, RingDirections(3, 5), RingDirections(3, 5), 0.5F},
                        {"1x1", 1, 1, RingDirections(3, 5), RingDirections(3, 5), -1.0F},
                        {"1x9", 1, 9, RingDirections(3, 5), RingDirections(3, 5), -1.0F},
                        {"9x1", 9, 1, RingDirections(3, 5), RingDirections(3, 5), -1.0F},
                        {"one pair", 4, 4, one, one, -1.0F},
                        {"one light", 4, 4, RingDirections(3, 5), one, -1.0F},
                        {"zenith only", 4, 4, {{0.0, 0.0}}, {{0.0, 0.0}}, 0.25F},
                        {"the same twice", 4, 4, {{0.3, 1.0}, {0.3, 1.0}}, RingDirections(3, 5), -1.0F}};
  for (const Case& c : cases) {
    SampledBtf btf = ShinyBtf(c.width, c.height, c.views, c.lights);
    if (c.value >= 0.0F) {
      for (int n = 0; n < c.width * c.height; ++n) {
        for (size_t i = 0; i < 3 * c.views.size() * c.lights.size(); ++i) {
          (&btf.at(n % c.width, n / c.width, 0, 0, 0))[i] = c.value;
        }
      }
    }
    const auto material = Encode("dfmf", btf, {.rank = 12});
    ASSERT_TRUE(material.ok()) << c.name << ": " << material.status();
    // What the nugget takes from eleven directions.
    EXPECT_LE(Rmse(btf, *material), 0.02) << c.name;
    const auto decoder = MakeDecoder(material->btfels);
    for (const double theta : {0.0, 0.7, 1.5}) {
      EXPECT_TRUE((*decoder)
                      ->Decode(material->btfels.btfel(0), VectorFromDirection({theta, 2.0}),
                               VectorFromDirection({0.5, theta}), 1)
                      .allFinite())
          << c.name;
    }
    const auto embedding = FindCodec("dfmf")->Embed(*material, 6, {});
    ASSERT_TRUE(embedding.ok()) << c.name << embedding.status();
    for (const float value : embedding->values) {
      ASSERT_TRUE(std::isfinite(value)) << c.name;
    }
  }
}

TEST(DfmfEncodeTest, RefusesWhatItCannotEncode) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 1e13F}) {
    SampledBtf btf = Shiny(5, 4);
    btf.at(3, 2, 1, 7, 5) = bad;
    const absl::Status status = Encode("dfmf", btf, {.rank = 2}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(Message(status), HasSubstr("view 7, light 5, texel (3, 2), channel 1"));
  }
  SampledBtf btf = Shiny(2, 2);
  EXPECT_THAT(Message(Encode("dfmf", btf, {.rank = -1}).status()), HasSubstr("rank = -1"));
  EXPECT_THAT(Message(Encode("dfmf", btf, {.rank = 5000}).status()), HasSubstr("rank = 5000"));
  EXPECT_THAT(Message(Encode("dfmf", btf, {.max_error = -0.5}).status()), HasSubstr("max_error"));
  EXPECT_THAT(Message(Encode("dfmf", btf, {.rank = 3, .max_bytes = 100}).status()), HasSubstr("at most one"));
  SampledBtf below(1, 1, {{1.7, 0.0}}, {{0.0, 0.0}});
  EXPECT_THAT(Message(Encode("dfmf", below, {.rank = 1}).status()), HasSubstr("views[0]"));
  SampledBtf none(1, 1, {{0.0, 0.0}}, {});
  EXPECT_THAT(Message(Encode("dfmf", none, {.rank = 1}).status()), HasSubstr("no lights"));
}

TEST(DfmfEncodeTest, StopsWhenAsked) {
  SampledBtf btf = Shiny(8, 8);
  std::stop_source stop;
  RunContext context;
  context.stop = stop.get_token();
  int reports = 0;
  context.progress = [&](const Progress& progress) {
    EXPECT_EQ(progress.stage, "encode");
    if (++reports == 12) {
      stop.request_stop();
    }
  };
  const auto material = FindCodec("dfmf")->Encode(btf, {.rank = 2, .memory_budget_bytes = 1}, context);
  EXPECT_EQ(material.status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(reports, 12);
}

// ----------------------------------------------------------------------------------------------------
// decoding

BtfelTable ShinyTable(int rank = 10) {
  SampledBtf btf = Shiny(4, 4, 7);
  return Encode("dfmf", btf, {.rank = rank})->btfels;
}

TEST(DfmfDecoderTest, NeverExtrapolates) {
  const BtfelTable table = ShinyTable();
  const auto decoder = DfmfDecoder::Create(table);
  ASSERT_TRUE(decoder.ok()) << decoder.status();
  const double limit = RadFromDeg(75.0);
  EXPECT_NEAR((*decoder)->max_light_theta_rad(), limit, 1e-9);
  std::vector<double> c(table.num_coefficients);
  (*decoder)->Dequantize(table.btfel(1), c);
  const auto evaluate = [&](const Direction& light, const Direction& view) {
    return (*decoder)->Evaluate(c, VectorFromDirection(light), VectorFromDirection(view));
  };
  const Direction inside{0.5, 2.0};
  EXPECT_GT(evaluate(inside, inside).maxCoeff(), 0.01);
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
  EXPECT_EQ((*decoder)->Evaluate(c, {1, 0, 0}, {0, 0, 1}).abs().maxCoeff(), 0.0);
}

TEST(DfmfDecoderTest, IsContinuous) {
  const BtfelTable table = ShinyTable();
  const auto decoder = MakeDecoder(table);
  ASSERT_TRUE(decoder.ok());
  // A walk over the pole and all azimuths: no step of 1e-4 rad may change the value by more than a slope of
  // 20 a radian, steeper than any of the data.
  constexpr double kStep = 1e-4;
  Rng rng(4);
  for (int i = 0; i < 2000; ++i) {
    const Direction d{1.4 * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()};
    const Eigen::Vector3d a = VectorFromDirection(d);
    const Eigen::Vector3d b =
        (a + kStep * Eigen::Vector3d(rng.NextDouble() - 0.5, rng.NextDouble() - 0.5, 0.0)).normalized();
    const Eigen::Vector3d view = VectorFromDirection({0.8, 1.0});
    const Eigen::Array3d difference =
        (*decoder)->Decode(table.btfel(3), a, view, 0) - (*decoder)->Decode(table.btfel(3), b, view, 0);
    EXPECT_LT(difference.abs().maxCoeff(), 20.0 * kStep) << d.theta_rad << ' ' << d.phi_rad;
  }
}

TEST(DfmfDecoderTest, ATurnIsATurnOfBothDirections) {
  const BtfelTable table = ShinyTable();
  const auto decoder = MakeDecoder(table);
  ASSERT_TRUE(decoder.ok());
  const double quarter = kPi / 2.0;
  for (int turns = 0; turns < 4; ++turns) {
    const Eigen::Array3d turned = (*decoder)->Decode(table.btfel(0), VectorFromDirection({0.6, 2.5}),
                                                     VectorFromDirection({0.4, 0.2}), turns);
    const Eigen::Array3d unturned =
        (*decoder)->Decode(table.btfel(0), VectorFromDirection({0.6, 2.5 - turns * quarter}),
                           VectorFromDirection({0.4, 0.2 - turns * quarter}), 0);
    EXPECT_LT((turned - unturned).abs().maxCoeff(), 1e-9);
  }
}

TEST(DfmfMaterialTest, ComesBackFromTheContainer) {
  SampledBtf btf = Shiny(6, 5);
  const auto material = Encode("dfmf", btf, {.rank = 9});
  ASSERT_TRUE(material.ok());
  const auto bytes = SerializeMaterial(*material);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  const auto back = ParseMaterial(std::as_bytes(std::span(*bytes)));
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->btfels.codes, material->btfels.codes);
  EXPECT_EQ(*SerializeMaterial(*back), *bytes);
  const auto a = MakeDecoder(material->btfels);
  const auto b = MakeDecoder(back->btfels);
  const Eigen::Vector3d light = VectorFromDirection({0.7, 4.0});
  const Eigen::Vector3d view = VectorFromDirection({1.1, 0.4});
  // Directions are stored as float32.
  EXPECT_LT(((*a)->Decode(material->btfels.btfel(7), light, view, 2) -
             (*b)->Decode(back->btfels.btfel(7), light, view, 2))
                .abs()
                .maxCoeff(),
            1e-5);
}

TEST(DfmfDecoderTest, RefusesTablesThatDoNotFit) {
  const BtfelTable good = ShinyTable();
  ASSERT_TRUE(MakeDecoder(good).ok());
  const auto expect = [&](const char* text, const auto& change) {
    BtfelTable table = good;
    change(table);
    const absl::Status status = MakeDecoder(table).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(Message(status), HasSubstr(text));
  };
  expect("'luma' is missing", [](BtfelTable& t) { t.tables.erase("luma"); });
  expect("'chroma' is missing", [](BtfelTable& t) { t.tables.erase("chroma"); });
  expect("'colour'", [](BtfelTable& t) { t.tables["colour"].shape = {9}; });
  expect("'luma'", [](BtfelTable& t) { t.tables["luma"].shape[0] += 1; });
  expect("'luma'", [](BtfelTable& t) { t.tables["luma"].shape[2] = int64_t{1} << 62; });
  expect("'luma_step'", [](BtfelTable& t) { t.tables["luma_step"].values.pop_back(); });
  expect("'chroma_offset'", [](BtfelTable& t) { t.tables["chroma_offset"].shape = {2}; });
  expect("coefficients", [](BtfelTable& t) { t.num_coefficients = 1; });
  expect("'chroma'", [](BtfelTable& t) {
    t.num_coefficients += 1;
    t.offset.push_back(0.0F);
    t.step.push_back(0.0F);
  });
  expect("view_nodes", [](BtfelTable& t) { t.parameters["view_nodes"] = 1001; });
  expect("odd", [](BtfelTable& t) { t.parameters["light_nodes"] = 8; });
  expect("light_trend", [](BtfelTable& t) { t.parameters.erase("light_trend"); });
  expect("trend = 5", [](BtfelTable& t) { t.parameters["view_trend"] = 5; });
  expect("nugget", [](BtfelTable& t) { t.parameters["nugget"] = 0.0; });
  expect("range", [](BtfelTable& t) { t.parameters["light_range"] = "wide"; });
  expect("bend", [](BtfelTable& t) { t.parameters["view_bend"] = 1.0; });
  expect("light_detail", [](BtfelTable& t) { t.parameters.erase("light_detail"); });
  expect("views", [](BtfelTable& t) { t.views.clear(); });
  expect("lights", [](BtfelTable& t) { t.lights.resize(3000, {0.0, 0.0}); });
  BtfelTable table = good;
  table.codec_version = 1;
  EXPECT_EQ(MakeDecoder(table).status().code(), absl::StatusCode::kUnimplemented);
}

}  // namespace
}  // namespace tessera
