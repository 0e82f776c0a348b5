#include "btf/chart/decode_cost.h"

#include <stop_token>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/data/direction_sets.h"
#include "btf/render/offscreen_context.h"
#include "tests/support/noise_btf.h"

namespace tessera {
namespace {

Material Encoded(int coefficients) {
  NoiseBtf source(20, 12, *DirectionSet("5x6"), *DirectionSet("5x6"));
  return *FindCodec("dsh")->Encode(source, {.kl = coefficients, .kv = coefficients}, {});
}

TEST(DecodeCostTest, MoreCoefficientsCostMore) {
  const auto few = MeasureCpuDecode(Encoded(4), {});
  const auto many = MeasureCpuDecode(Encoded(36), {});
  ASSERT_TRUE(few.ok() && many.ok());
  EXPECT_GT(few->streaming_s, 0.0);
  // 81 times as many.
  EXPECT_GT(many->streaming_s, 3.0 * few->streaming_s);
  EXPECT_GT(many->random_s, few->random_s);
}

TEST(DecodeCostTest, AFrameIsCoveredWhateverTheSizeOfTheTexture) {
  const auto context = CreateOsmesaContext();
  ASSERT_TRUE(context.ok()) << context.status();
  const auto cost = MeasureGlFrame(**context, Encoded(16), {});
  ASSERT_TRUE(cost.ok()) << cost.status();
  EXPECT_GT(cost->prepare_s, 0.0);
  EXPECT_GT(cost->bilinear_s, cost->nearest_s);
  NoiseBtf one(1, 1, *DirectionSet("1x3"), *DirectionSet("1x3"));
  const auto texel = FindCodec("dsh")->Encode(one, {.kl = 1, .kv = 1}, {});
  ASSERT_TRUE(texel.ok());
  EXPECT_TRUE(MeasureGlFrame(**context, *texel, {}).ok());
}

TEST(DecodeCostTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  RunContext run;
  run.stop = stop.get_token();
  const Material material = Encoded(4);
  EXPECT_EQ(MeasureCpuDecode(material, run).status().code(), absl::StatusCode::kCancelled);
  const auto context = CreateOsmesaContext();
  ASSERT_TRUE(context.ok());
  EXPECT_EQ(MeasureGlFrame(**context, material, run).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
