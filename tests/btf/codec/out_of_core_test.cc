// Encoding with less memory than the samples, the coefficients or the result take; tests/bench/
// out_of_core_bench.cc is the same at the size of the largest published BTFs.
#include <string>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/data/direction_sets.h"
#include "tests/support/codecs.h"
#include "tests/support/noise_btf.h"

namespace tessera {
namespace {

class OutOfCoreTest : public ::testing::TestWithParam<std::string> {};

TEST_P(OutOfCoreTest, SameBytesWithinATinyBudget) {
  constexpr int kSize = 96;
  constexpr uint64_t kTinyBudget = uint64_t{4} << 20;
  const Codec* codec = FindCodec(GetParam());
  ASSERT_NE(codec, nullptr);
  const auto directions = DirectionSet("5x5");
  ASSERT_TRUE(directions.ok()) << directions.status();
  NoiseBtf source(kSize, kSize, *directions, *directions);
  const EncodeParams params{.kl = 16, .kv = 16, .memory_budget_bytes = uint64_t{1} << 30};
  const auto in_memory = codec->Encode(source, params, {});
  ASSERT_TRUE(in_memory.ok()) << in_memory.status();
  EXPECT_FALSE(in_memory->btfels.codes.is_spilled());

  EncodeParams tiny = params;
  tiny.memory_budget_bytes = kTinyBudget;
  NoiseBtf again(kSize, kSize, *directions, *directions);
  const auto out_of_core = codec->Encode(again, tiny, {});
  ASSERT_TRUE(out_of_core.ok()) << out_of_core.status();
  EXPECT_EQ(out_of_core->btfels.codes.is_spilled(), out_of_core->btfels.codes.size() > kTinyBudget / 4);
  EXPECT_LE(again.largest_request() * again.SamplesPerRow() * sizeof(float), kTinyBudget);
  const auto expected = SerializeMaterial(*in_memory);
  const auto bytes = SerializeMaterial(*out_of_core);
  ASSERT_TRUE(expected.ok() && bytes.ok());
  EXPECT_TRUE(*bytes == *expected);
}

INSTANTIATE_TEST_SUITE_P(AllCodecs, OutOfCoreTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);

}  // namespace
}  // namespace tessera
