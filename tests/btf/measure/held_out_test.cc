#include "btf/measure/held_out.h"

#include <cmath>
#include <memory>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/data/direction_sets.h"
#include "tests/support/noise_btf.h"

namespace tessera {
namespace {

using ::testing::ElementsAre;

TEST(SplitTest, HoldsOutWholeDirectionsEveryFifth) {
  BtfInfo info;
  info.views.resize(11);
  info.lights.resize(6);
  EXPECT_TRUE(SplitExists(info, Split::kHeldOutLights));
  EXPECT_THAT(EncodedPart(info, Split::kHeldOutLights).lights, ElementsAre(0, 1, 2, 3, 5));
  EXPECT_TRUE(EncodedPart(info, Split::kHeldOutLights).views.empty());
  EXPECT_THAT(MeasuredPairs(info, Split::kHeldOutLights).lights, ElementsAre(4));
  EXPECT_EQ(MeasuredPairs(info, Split::kHeldOutLights).size(), 11U);
  EXPECT_THAT(EncodedPart(info, Split::kHeldOutViews).views, ElementsAre(0, 1, 2, 3, 5, 6, 7, 8, 10));
  EXPECT_THAT(MeasuredPairs(info, Split::kHeldOutViews).views, ElementsAre(4, 9));
  EXPECT_EQ(MeasuredPairs(info, Split::kSampled).size(), 66U);
  info.lights.resize(4);
  EXPECT_FALSE(SplitExists(info, Split::kHeldOutLights));
}

TEST(HeldOutTest, AgreesWithEncodingByHand) {
  NoiseBtf source(6, 8, *DirectionSet("4x6"), *DirectionSet("3x5"));
  const Codec& codec = *FindCodec("dsh-cls");
  const EncodeParams params{.kl = 4, .kv = 4};
  const auto errors = MeasureHeldOut(source, codec, params, {.row_stride = 2}, {});
  ASSERT_TRUE(errors.ok()) << errors.status();

  const auto all = codec.Encode(source, params, {});
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(errors->size_bytes, SerializeMaterial(*all)->size());
  const auto part = SubsetBtf::Create(source, {.lights = KeptDirections(15)});
  const auto without = codec.Encode(**part, params, {});
  ASSERT_TRUE(without.ok());
  const auto at_lights =
      MeasureMaterial(source, *without, MeasuredPairs(source.info(), Split::kHeldOutLights), 2, {});
  ASSERT_TRUE(at_lights.ok());
  EXPECT_DOUBLE_EQ(errors->lights_rmse.value(), Total(*at_lights).rmse());
  // The material that has seen those lights is another one.
  const auto seen = MeasureMaterial(source, *all, MeasuredPairs(source.info(), Split::kHeldOutLights), 2, {});
  EXPECT_NE(errors->lights_rmse.value(), Total(*seen).rmse());
  EXPECT_GT(errors->views_rmse.value(), 0.0);
  EXPECT_GT(errors->reference_rms, errors->sampled_rmse);
}

TEST(HeldOutTest, FewDirectionsHoldNothingOut) {
  NoiseBtf source(4, 4, *DirectionSet("1x4"), *DirectionSet("2x5"));
  const auto errors = MeasureHeldOut(source, *FindCodec("dsh"), {.kl = 1, .kv = 1}, {}, {});
  ASSERT_TRUE(errors.ok()) << errors.status();
  EXPECT_FALSE(errors->views_rmse.has_value());
  EXPECT_TRUE(errors->lights_rmse.has_value());
}

TEST(HeldOutTest, TheCodecsRefusalIsTheAnswer) {
  NoiseBtf source(4, 4, *DirectionSet("2x5"), *DirectionSet("2x5"));
  EXPECT_EQ(MeasureHeldOut(source, *FindCodec("dsh"), {.kl = 5}, {}, {}).status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera
