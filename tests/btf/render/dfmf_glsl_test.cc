#include "btf/codec/dfmf/dfmf_glsl.h"

#include <gtest/gtest.h>

#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/blend_queries.h"
#include "tests/btf/render/codec_preview.h"

namespace tessera {
namespace {

SampledBtf Shiny() {
  return ShinyBtf(8, 6, RingDirections(4, 9), RingDirections(4, 12, 60.0));
}

BtfelTable Encoded(BtfSource& btf, int rank) {
  return FindCodec("dfmf")->Encode(btf, {.rank = rank}, {})->btfels;
}

// Factors and coefficients are off by up to 2^-16 of the largest contribution of their group, 1.5e-5 of about
// 1 for the first; each of them has its own sign.
constexpr double kTolerance = 2e-5;

TEST(DfmfGlslTest, BlendsWhatTheDecoderBlends) {
  SampledBtf btf = Shiny();
  // Ranks within one group of eight, at its end, and of several groups.
  for (const int rank : {1, 3, 8, 13, 30, 48}) {
    const BtfelTable table = Encoded(btf, rank);
    const auto glsl = DfmfGlsl(table);
    ASSERT_TRUE(glsl.ok()) << glsl.status();
    SCOPED_TRACE(rank);
    testing::ExpectBlendsWhatTheDecoderBlends(table, *glsl, kTolerance);
  }
}

TEST(DfmfGlslTest, BlendsGreyTexelsWithoutChrominance) {
  SampledBtf btf = Shiny();
  for (int n = 0; n < 48; ++n) {
    for (size_t v = 0; v < btf.info().views.size(); ++v) {
      for (size_t l = 0; l < btf.info().lights.size(); ++l) {
        btf.at(n % 8, n / 8, 1, v, l) = btf.at(n % 8, n / 8, 0, v, l);
        btf.at(n % 8, n / 8, 2, v, l) = btf.at(n % 8, n / 8, 0, v, l);
      }
    }
  }
  const BtfelTable table = Encoded(btf, 9);
  ASSERT_FALSE(table.tables.contains("chroma"));
  const auto glsl = DfmfGlsl(table);
  ASSERT_TRUE(glsl.ok()) << glsl.status();
  testing::ExpectBlendsWhatTheDecoderBlends(table, *glsl, kTolerance);
}

TEST(DfmfGlslTest, PreviewsAsTheReferenceDoes) {
  SampledBtf btf = Shiny();
  testing::ExpectPreviewsAsTheReferenceDoes(Encoded(btf, 20));
}

TEST(DfmfGlslTest, RefusesTablesThatDoNotFit) {
  SampledBtf btf = Shiny();
  BtfelTable table = Encoded(btf, 5);
  table.tables.erase("luma");
  EXPECT_EQ(DfmfGlsl(table).status().code(), absl::StatusCode::kInvalidArgument);
  table = Encoded(btf, 5);
  table.codes.pop_back();
  EXPECT_EQ(DfmfGlsl(table).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera
