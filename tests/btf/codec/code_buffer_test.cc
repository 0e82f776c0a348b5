// Codes in memory and in a spill file.
#include <numeric>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "btf/codec/code_buffer.h"

namespace tessera {
namespace {

TEST(CodeBufferTest, IsTheSameInMemoryAndInAFile) {
  constexpr size_t kSize = 10000;
  for (const uint64_t limit : {uint64_t{kSize}, uint64_t{kSize - 1}}) {
    absl::StatusOr<CodeBuffer> created = CodeBuffer::Create(kSize, limit);
    ASSERT_TRUE(created.ok()) << created.status();
    CodeBuffer codes = *std::move(created);
    EXPECT_EQ(codes.is_spilled(), limit < kSize);
    EXPECT_EQ(codes, std::vector<uint8_t>(kSize));
    std::iota(codes.begin(), codes.end(), uint8_t{3});
    codes.DropPages();
    std::vector<uint8_t> expected(kSize);
    std::iota(expected.begin(), expected.end(), uint8_t{3});
    EXPECT_EQ(codes, expected);
    std::vector<uint8_t> part(4000);
    ASSERT_TRUE(codes.Read(5000, part).ok());
    EXPECT_TRUE(std::equal(part.begin(), part.end(), expected.begin() + 5000));

    const CodeBuffer copy = codes;
    EXPECT_FALSE(copy.is_spilled());
    codes[0] = 77;
    EXPECT_EQ(copy, expected);
    const CodeBuffer moved = std::move(codes);
    EXPECT_EQ(moved.is_spilled(), limit < kSize);
    EXPECT_EQ(moved[0], 77);
    EXPECT_TRUE(codes.empty());  // NOLINT(bugprone-use-after-move): that is what is tested
  }
}

TEST(CodeBufferTest, ChangesItsSizeLikeAVector) {
  for (const uint64_t limit : {3, 0}) {
    CodeBuffer codes = *CodeBuffer::Create(3, limit);
    codes[1] = 5;
    codes.push_back(6);
    codes.insert(codes.end(), &codes[1], &codes[2]);
    EXPECT_EQ(codes, (std::vector<uint8_t>{0, 5, 0, 6, 5}));
    codes.pop_back();
    codes.resize(2);
    EXPECT_EQ(codes, (std::vector<uint8_t>{0, 5}));
    codes.assign(2, 9);
    EXPECT_EQ(codes, (std::vector<uint8_t>{9, 9}));
  }
  EXPECT_TRUE(CodeBuffer::Create(0, 0)->empty());
}

}  // namespace
}  // namespace tessera
