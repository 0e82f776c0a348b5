// The first components of a factorisation against factorisations of that rank.
#include "btf/choice/dfmf_prefix.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/codec/dfmf/dfmf_decoder.h"
#include "btf/data/direction_sets.h"
#include "btf/data/memory_btf.h"
#include "btf/stability/analytic_btf.h"

namespace tessera {
namespace {

std::unique_ptr<MemoryBtf> Bumpy() {
  const AnalyticSurface surface{.width = 12, .height = 10};
  BtfInfo info{.width = 12, .height = 10, .views = *DirectionSet("3x6"), .lights = *DirectionSet("3x5")};
  std::vector<float> samples = AnalyticSamples(surface, info.views, info.lights);
  return *MemoryBtf::Create(std::move(info), std::move(samples));
}

std::vector<size_t> All(const BtfelTable& table) {
  std::vector<size_t> texels(table.size());
  std::iota(texels.begin(), texels.end(), 0);
  return texels;
}

// Root mean square of what two tables decode to, apart, and of the first alone.
std::pair<double, double> Difference(const BtfelTable& a, const BtfelTable& b) {
  const auto decode_a = *MakeDecoder(a);
  const auto decode_b = *MakeDecoder(b);
  std::vector<float> rgb_a(3 * a.size());
  std::vector<float> rgb_b(3 * b.size());
  double difference = 0.0;
  double signal = 0.0;
  for (const Direction& view : a.views) {
    for (const Direction& light : a.lights) {
      decode_a->DecodeTexels(a.codes, VectorFromDirection(light), VectorFromDirection(view), 0, rgb_a);
      decode_b->DecodeTexels(b.codes, VectorFromDirection(light), VectorFromDirection(view), 0, rgb_b);
      for (size_t i = 0; i < rgb_a.size(); ++i) {
        difference += std::pow(rgb_a[i] - rgb_b[i], 2.0);
        signal += std::pow(rgb_a[i], 2.0);
      }
    }
  }
  return {std::sqrt(difference), std::sqrt(signal)};
}

TEST(DfmfPrefixTest, IsWhatTheEncoderMakesOfThatRank) {
  const auto btf = Bumpy();
  const Codec* dfmf = FindCodec("dfmf");
  const auto large = dfmf->Encode(*btf, {.rank = 24}, {});
  ASSERT_TRUE(large.ok()) << large.status();
  for (const int rank : {1, 4, 9, 15}) {
    const auto direct = dfmf->Encode(*btf, {.rank = rank}, {});
    ASSERT_TRUE(direct.ok());
    const DfmfRanks ranks = DfmfSplit(large->btfels, rank);
    EXPECT_EQ(ranks.luma + ranks.chroma, rank);
    EXPECT_NEAR(ranks.luma, direct->btfels.tables.at(kDfmfLuma).shape.back(), 1) << rank;
    const BtfelTable prefix = DfmfPrefix(large->btfels, ranks, All(large->btfels));
    const auto [difference, signal] = Difference(direct->btfels, prefix);
    // Vectors of nearly equal singular values may mix in either.
    EXPECT_LT(difference, 0.02 * signal) << rank;
  }
}

TEST(DfmfPrefixTest, AllOfThemAreTheTable) {
  const auto btf = Bumpy();
  const auto material = FindCodec("dfmf")->Encode(*btf, {.rank = 10}, {});
  ASSERT_TRUE(material.ok());
  const DfmfRanks ranks = DfmfSplit(material->btfels, 999);
  ASSERT_EQ(ranks.luma + ranks.chroma, material->btfels.num_coefficients);
  const BtfelTable all = DfmfPrefix(material->btfels, ranks, All(material->btfels));
  EXPECT_EQ(all.codes, material->btfels.codes);
  EXPECT_EQ(Difference(material->btfels, all).first, 0.0);
}

TEST(DfmfPrefixTest, HoldsTheTexelsAskedFor) {
  const auto btf = Bumpy();
  const auto material = FindCodec("dfmf")->Encode(*btf, {.rank = 6}, {});
  ASSERT_TRUE(material.ok());
  const std::vector<size_t> texels = {3, 50, 119};
  const BtfelTable some = DfmfPrefix(material->btfels, DfmfSplit(material->btfels, 6), texels);
  ASSERT_EQ(some.size(), texels.size());
  for (size_t i = 0; i < texels.size(); ++i) {
    EXPECT_TRUE(std::ranges::equal(some.btfel(i), material->btfels.btfel(texels[i])));
  }
}

}  // namespace
}  // namespace tessera
