#include "btf/measure/pair_errors.h"

#include <cmath>
#include <memory>
#include <stop_token>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/image/transfer.h"
#include "tests/support/noise_btf.h"
#include "tests/support/read_btf.h"

namespace tessera {
namespace {

// Direct sums differ in their order, and sRGB codes come from a table exact to 1e-5.
constexpr double kRounding = 1e-9;
constexpr double kCodedRounding = 1e-4;

std::vector<Direction> Ring(int count) {
  std::vector<Direction> directions = {{0.0, 0.0}};
  for (int i = 1; i < count; ++i) {
    directions.push_back({RadFromDeg(50.0), 2.0 * kPi * i / (count - 1)});
  }
  return directions;
}

TEST(PairErrorsTest, AgreesWithTexelByTexelDecoding) {
  NoiseBtf source(7, 6, Ring(6), Ring(7));
  const auto material = FindCodec("dsh")->Encode(source, {.kl = 4, .kv = 4}, {});
  ASSERT_TRUE(material.ok()) << material.status();
  const PairSet pairs{{1, 4}, {0, 2, 6}};
  const auto errors = MeasureMaterial(source, *material, pairs, /*row_stride=*/4, {});
  ASSERT_TRUE(errors.ok()) << errors.status();

  const std::vector<float> samples = AllSamples(source);
  const auto decoder = MakeDecoder(material->btfels);
  for (size_t v = 0; v < pairs.views.size(); ++v) {
    for (size_t l = 0; l < pairs.lights.size(); ++l) {
      SquareSums expected;
      for (const int y : {0, 4}) {
        for (int x = 0; x < 7; ++x) {
          const Eigen::Array3d rgb = (*decoder)->Decode(
              material->btfels.btfel(y * 7 + x), VectorFromDirection(source.info().lights[pairs.lights[l]]),
              VectorFromDirection(source.info().views[pairs.views[v]]), 0);
          for (int c = 0; c < 3; ++c) {
            const double truth = samples[(((y * 7 + x) * 3 + c) * 6 + pairs.views[v]) * 7 + pairs.lights[l]];
            const auto coded = [](double value) {
              return SrgbFromLinear(std::min(1.0, std::max(0.0, value)));
            };
            expected.Add(
                {std::pow(rgb[c] - truth, 2), truth * truth, std::pow(coded(rgb[c]) - coded(truth), 2), 1});
          }
        }
      }
      const SquareSums& sums = errors->sums[v * 3 + l];
      EXPECT_EQ(sums.num_samples, expected.num_samples);
      EXPECT_NEAR(sums.references, expected.references, kRounding * expected.references);
      EXPECT_NEAR(sums.errors, expected.errors, 1e-4 * expected.errors);  // DecodeTexels is single precision
      EXPECT_NEAR(sums.coded_errors, expected.coded_errors, kCodedRounding);
      EXPECT_GT(sums.errors, 0.0);
    }
  }
}

TEST(PairErrorsTest, TheSameForAnyNumberOfThreads) {
  NoiseBtf source(5, 5, Ring(9), Ring(9));
  const RowPredictor grey = [](int y, int view, int light, std::span<float> rgb) {
    for (float& v : rgb) {
      v = 0.1F * static_cast<float>(y + view + light);
    }
  };
  PairSet pairs{{0, 1, 2, 3, 4, 5, 6, 7, 8}, {0, 1, 2, 3, 4, 5, 6, 7, 8}};
  RunContext one;
  one.num_threads = 1;
  const auto a = MeasurePairs(source, grey, pairs, 1, one);
  const auto b = MeasurePairs(source, grey, pairs, 1, {});
  ASSERT_TRUE(a.ok() && b.ok());
  for (size_t i = 0; i < a->sums.size(); ++i) {
    EXPECT_EQ(a->sums[i].errors, b->sums[i].errors);
    EXPECT_EQ(a->sums[i].coded_errors, b->sums[i].coded_errors);
  }
}

TEST(PairErrorsTest, FiguresOfSums) {
  SquareSums sums{.errors = 4.0, .references = 16.0, .coded_errors = 0.04, .num_samples = 4};
  EXPECT_DOUBLE_EQ(sums.rmse(), 1.0);
  EXPECT_DOUBLE_EQ(sums.reference_rms(), 2.0);
  EXPECT_DOUBLE_EQ(sums.relative_rmse(), 0.5);
  EXPECT_NEAR(sums.psnr_db(), 20.0, 1e-12);
  EXPECT_EQ(SquareSums{}.rmse(), 0.0);
  EXPECT_TRUE(std::isinf(SquareSums{}.psnr_db()));
}

TEST(PairErrorsTest, RefusesWhatIsNotThere) {
  NoiseBtf source(4, 4, Ring(5), Ring(5));
  const RowPredictor nothing = [](int, int, int, std::span<float>) {};
  for (const PairSet& pairs : {PairSet{{5}, {0}}, PairSet{{0}, {-1}}, PairSet{{}, {0}}}) {
    EXPECT_EQ(MeasurePairs(source, nothing, pairs, 1, {}).status().code(),
              absl::StatusCode::kInvalidArgument);
  }
  EXPECT_EQ(MeasurePairs(source, nothing, {{0}, {0}}, 0, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
  Material other;
  other.width = 3;
  other.height = 4;
  EXPECT_EQ(MeasureMaterial(source, other, {{0}, {0}}, 1, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
  std::stop_source stop;
  stop.request_stop();
  RunContext context;
  context.stop = stop.get_token();
  EXPECT_EQ(MeasurePairs(source, nothing, {{0}, {0}}, 1, context).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
