#include "btf/base/huge_pages.h"

#include <cstdint>

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(HugeBufferTest, IsAlignedAndOwnMemory) {
  const HugeBuffer<float> a = AllocateHuge<float>(1000);
  const HugeBuffer<float> b = AllocateHuge<float>(1000);
  EXPECT_NE(a.get(), b.get());
  EXPECT_EQ(reinterpret_cast<uintptr_t>(a.get()) % kHugePageBytes, 0);
  EXPECT_EQ(a.get_deleter().bytes, kHugePageBytes);
  a[999] = 1.0F;
  b[999] = 2.0F;
  EXPECT_EQ(a[999], 1.0F);
}

TEST(HugeBufferTest, IsKeptForTheNextOfItsSize) {
  constexpr size_t kCount = 5 * kHugePageBytes;
  HugeBuffer<uint8_t> buffer = AllocateHuge<uint8_t>(kCount);
  const uint8_t* const data = buffer.get();
  buffer.reset();
  // Another size leaves it there: too large for it, or too small to be worth it.
  const HugeBuffer<uint8_t> larger = AllocateHuge<uint8_t>(kCount + 1);
  const HugeBuffer<uint8_t> smaller = AllocateHuge<uint8_t>(kCount / 5);
  EXPECT_NE(larger.get(), data);
  EXPECT_NE(smaller.get(), data);
  const HugeBuffer<uint8_t> next = AllocateHuge<uint8_t>(kCount - 100);
  EXPECT_EQ(next.get(), data);
  EXPECT_EQ(next.get_deleter().bytes, kCount);
}

TEST(HugeBufferTest, KeptOnesGiveWay) {
  constexpr size_t kCount = 7 * kHugePageBytes;
  AllocateHuge<uint8_t>(kCount).reset();
  EXPECT_GE(KeptHugeBlockBytes(), kCount);
  // Nothing is touched, so it costs no memory. One beyond the limit is not kept, and leaves no room for
  // others.
  HugeBuffer<uint8_t> huge = AllocateHuge<uint8_t>(kMaxKeptHugeBytes + 1);
  EXPECT_EQ(KeptHugeBlockBytes(), 0);
  huge.reset();
  EXPECT_EQ(KeptHugeBlockBytes(), 0);
  AllocateHuge<uint8_t>(kCount).reset();
  huge = AllocateHuge<uint8_t>(kMaxKeptHugeBytes);
  EXPECT_EQ(KeptHugeBlockBytes(), 0);
  huge.reset();
  EXPECT_EQ(KeptHugeBlockBytes(), kMaxKeptHugeBytes);
}

}  // namespace
}  // namespace tessera
