#include "btf/base/rng.h"

#include <array>

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(Mix64Test, IsTheFixedPublishedFunction) {
  // First outputs of SplitMix64 seeded with 0, as published with the algorithm. Dressings depend on these
  // bits.
  Rng rng(0);
  EXPECT_EQ(rng.Next(), 0xe220a8397b1dcdafULL);
  EXPECT_EQ(rng.Next(), 0x6e789e6aa1b965f4ULL);
  EXPECT_EQ(rng.Next(), 0x06c45d188009454fULL);
}

TEST(Mix64Test, PairMixDependsOnOrder) {
  EXPECT_NE(Mix64(1, 2), Mix64(2, 1));
}

TEST(RngTest, NextBelowIsUniform) {
  Rng rng(7);
  constexpr int kBins = 10;
  constexpr int kDraws = 100000;
  std::array<int, kBins> counts{};
  for (int i = 0; i < kDraws; ++i) {
    ++counts[rng.NextBelow(kBins)];
  }
  double chi_square = 0.0;
  for (const int count : counts) {
    const double expected = double{kDraws} / kBins;
    chi_square += (count - expected) * (count - expected) / expected;
  }
  constexpr double kChiSquare9Dof999 = 27.9;  // 99.9% quantile at 9 degrees of freedom
  EXPECT_LT(chi_square, kChiSquare9Dof999);
}

TEST(RngTest, NextDoubleStaysBelowOne) {
  Rng rng(1);
  for (int i = 0; i < 1000; ++i) {
    const double value = rng.NextDouble();
    EXPECT_GE(value, 0.0);
    EXPECT_LT(value, 1.0);
  }
}

}  // namespace
}  // namespace tessera
