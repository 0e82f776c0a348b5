#include "btf/codec/range_coder.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

#include "btf/base/rng.h"

namespace tessera {
namespace {

std::vector<int32_t> BackFrom(const std::vector<uint8_t>& bytes, size_t count, size_t stride) {
  std::vector<int32_t> numbers(count);
  const absl::Status status = ReadNumbers(bytes, stride, numbers);
  EXPECT_TRUE(status.ok()) << status;
  return numbers;
}

TEST(RangeCoderTest, NumbersOfEverySizeComeBack) {
  Rng rng(1);
  for (const size_t stride : {1u, 7u, 1000u}) {
    std::vector<int32_t> numbers = {0, -1, 1, std::numeric_limits<int32_t>::max(),
                                    -std::numeric_limits<int32_t>::max()};
    for (int i = 0; i < 20000; ++i) {
      const auto value = static_cast<int32_t>(rng.NextBelow(uint64_t{1} << rng.NextBelow(31)));
      numbers.push_back(i % 3 == 0 ? -value : value);
    }
    EXPECT_EQ(BackFrom(WriteNumbers(numbers, stride), numbers.size(), stride), numbers) << stride;
  }
  EXPECT_TRUE(WriteNumbers({}, 1).empty());
  EXPECT_TRUE(BackFrom({}, 0, 1).empty());
}

// Carries run through bytes that are written: decisions against all odds make them.
TEST(RangeCoderTest, DecisionsAgainstTheOddsComeBack) {
  Rng rng(2);
  std::vector<bool> bits;
  for (int i = 0; i < 200000; ++i) {
    bits.push_back(i % 1000 < 500 ? rng.NextBelow(200) == 0 : rng.NextBelow(200) != 0);
  }
  RangeWriter writer;
  AdaptiveBit write_context;
  for (const bool bit : bits) {
    writer.Write(bit, write_context);
  }
  const std::vector<uint8_t> bytes = std::move(writer).Finish();
  RangeReader reader(bytes);
  AdaptiveBit read_context;
  for (size_t i = 0; i < bits.size(); ++i) {
    ASSERT_EQ(reader.Read(read_context), bits[i]) << i;
  }
  EXPECT_TRUE(reader.CheckEnd().ok());
}

// Numbers whose size falls along rows of 50, as those of cosines do: within a tenth of their entropy.
TEST(RangeCoderTest, TakesHardlyMoreThanTheEntropy) {
  constexpr size_t kStride = 50;
  Rng rng(3);
  std::vector<int32_t> numbers;
  double bits = 0.0;
  for (int row = 0; row < 400; ++row) {
    const double zero = 1.0 - std::exp(-0.02 * row) / 2.0;
    for (size_t i = 0; i < kStride; ++i) {
      const bool is_zero = rng.NextDouble() < zero;
      const bool is_negative = rng.NextBelow(2) == 0;
      numbers.push_back(is_zero ? 0 : is_negative ? -1 : 1);
      bits -= is_zero ? std::log2(zero) : std::log2((1.0 - zero) / 2.0);
    }
  }
  const std::vector<uint8_t> bytes = WriteNumbers(numbers, kStride);
  EXPECT_LT(static_cast<double>(bytes.size()), 1.1 * bits / 8.0);
  EXPECT_GT(static_cast<double>(bytes.size()), 0.95 * bits / 8.0);
}

TEST(RangeCoderTest, BytesThatAreLeftAreRefusedAndOtherDamageReadsAsSomething) {
  std::vector<uint8_t> bytes = WriteNumbers(std::vector<int32_t>(100, 5), 10);
  std::vector<int32_t> numbers(100);
  EXPECT_TRUE(absl::IsInvalidArgument(ReadNumbers(bytes, 10, std::span(numbers).first(3))));
  bytes.insert(bytes.end(), 10, 1);
  EXPECT_TRUE(absl::IsInvalidArgument(ReadNumbers(bytes, 10, numbers)));
  Rng rng(4);
  for (int i = 0; i < 200; ++i) {
    std::vector<uint8_t> random(rng.NextBelow(64));
    for (uint8_t& byte : random) {
      byte = static_cast<uint8_t>(rng.NextBelow(256));
    }
    (void)ReadNumbers(random, 3, numbers);
  }
}

}  // namespace
}  // namespace tessera
