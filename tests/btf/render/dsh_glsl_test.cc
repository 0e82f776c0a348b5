#include "btf/codec/dsh/dsh_glsl.h"

#include <string>
#include <string_view>

#include <gtest/gtest.h>

#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/blend_queries.h"
#include "tests/btf/render/hand_made.h"

namespace tessera {
namespace {

using testing::BasisKind;
using testing::ExpectBlendsWhatTheDecoderBlends;
using testing::RandomBtfels;

struct Size {
  int kl = 0;
  int kv = 0;
  BasisKind basis = BasisKind::kIdentity;
};

class DshGlslTest : public ::testing::TestWithParam<Size> {};

TEST_P(DshGlslTest, BlendsWhatTheDecoderBlends) {
  const BtfelTable table = RandomBtfels(40, GetParam().kl, GetParam().kv, 11, GetParam().basis);
  const auto glsl = DshGlsl(table);
  ASSERT_TRUE(glsl.ok()) << glsl.status();
  // Float sums of up to 7,203 terms.
  ExpectBlendsWhatTheDecoderBlends(table, *glsl, 2e-5);
}

INSTANTIATE_TEST_SUITE_P(Sizes, DshGlslTest,
                         ::testing::Values(Size{25, 25}, Size{1, 1}, Size{4, 1}, Size{9, 16}, Size{36, 4},
                                           Size{49, 49}, Size{25, 9, BasisKind::kGeneral},
                                           Size{16, 25, BasisKind::kByOrder},
                                           Size{25, 25, BasisKind::kOrthonormal},
                                           Size{49, 49, BasisKind::kOrthonormal},
                                           Size{9, 25, BasisKind::kOrthonormal}),
                         [](const auto& info) {
                           return "kl" + std::to_string(info.param.kl) + "kv" +
                                  std::to_string(info.param.kv) +
                                  (info.param.basis == BasisKind::kIdentity  ? ""
                                   : info.param.basis == BasisKind::kByOrder ? "ByOrder"
                                   : info.param.basis == BasisKind::kGeneral ? "General"
                                                                             : "Orthonormal");
                         });

// The magnitudes of real coefficients are no product of one of the light and one of the view function.
TEST(DshGlsl, BlendsEncodingsAsTheDecoderDoes) {
  SampledBtf btf = ShinyBtf(8, 6, RingDirections(6, 16), RingDirections(6, 16));
  for (const std::string_view codec : {"dsh", "dsh-cls"}) {
    const auto material = FindCodec(codec)->Encode(btf, {.kl = 25, .kv = 25}, {});
    ASSERT_TRUE(material.ok()) << material.status();
    const auto glsl = DshGlsl(material->btfels);
    ASSERT_TRUE(glsl.ok()) << glsl.status();
    SCOPED_TRACE(std::string(codec));
    ExpectBlendsWhatTheDecoderBlends(material->btfels, *glsl, 2e-5);
  }
}

TEST(DshGlsl, RefusesTablesThatDoNotFit) {
  BtfelTable table = RandomBtfels(3, 4, 4, 1);
  table.tables.erase("basis_view");
  EXPECT_EQ(DshGlsl(table).status().code(), absl::StatusCode::kInvalidArgument);
  table = RandomBtfels(3, 4, 4, 1);
  table.tables["basis_light"].shape = {5, 5};
  EXPECT_EQ(DshGlsl(table).status().code(), absl::StatusCode::kInvalidArgument);
  table = RandomBtfels(3, 4, 4, 1);
  table.step.pop_back();
  EXPECT_EQ(DshGlsl(table).status().code(), absl::StatusCode::kInvalidArgument);
  table = RandomBtfels(3, 4, 4, 1);
  table.codes.pop_back();
  EXPECT_EQ(DshGlsl(table).status().code(), absl::StatusCode::kInvalidArgument);
  table = RandomBtfels(3, 4, 4, 1);
  table.views.clear();
  EXPECT_EQ(DshGlsl(table).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera
