#include "btf/wang/arrangement.h"

#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(TileCodeTest, FollowsTheFormulaAndInverts) {
  // south 1+, east 0-, north 1-, west 0+: 1 + 2*4 + 3*16 + 0*64.
  EXPECT_EQ(TileCode({TileSide{1, Sign::kPlus}, TileSide{0, Sign::kMinus}, TileSide{1, Sign::kMinus},
                      TileSide{0, Sign::kPlus}}),
            57u);
  for (uint32_t code = 0; code < 256; ++code) {
    EXPECT_EQ(TileCode(SidesFromTileCode(code)), code);
  }
}

TEST(ArrangementTest, Plane16HasEveryColouringOfOneSignPattern) {
  const Arrangement& plane = **FindArrangement("plane-16");
  ASSERT_EQ(plane.codes.size(), 16u);
  EXPECT_FALSE(plane.turned_strips);
  std::set<uint32_t> seen;
  for (const uint32_t code : plane.codes) {
    const TileSides sides = SidesFromTileCode(code);
    EXPECT_EQ(sides[0].sign, Sign::kPlus);
    EXPECT_EQ(sides[1].sign, Sign::kPlus);
    EXPECT_EQ(sides[2].sign, Sign::kMinus);
    EXPECT_EQ(sides[3].sign, Sign::kMinus);
    seen.insert(code);
  }
  EXPECT_EQ(seen.size(), 16u);
  EXPECT_EQ(plane.codes.front(), 160u);  // (0 + 2) * 16 + (0 + 2) * 64
}

TEST(ArrangementTest, Surface96HasEveryTileOfTwoPlusAndTwoMinus) {
  const Arrangement& surface = **FindArrangement("surface-96");
  ASSERT_EQ(surface.codes.size(), 96u);
  EXPECT_TRUE(surface.turned_strips);
  int half_turn_symmetric = 0;
  for (const uint32_t code : surface.codes) {
    const TileSides sides = SidesFromTileCode(code);
    EXPECT_EQ(std::count_if(sides.begin(), sides.end(), [](auto& s) { return s.sign == Sign::kPlus; }), 2);
    half_turn_symmetric += sides[0] == sides[2] && sides[1] == sides[3];
    // Closed under quarter turns, so any tile may be laid in any turn.
    EXPECT_GE(surface.IndexOfCode(TileCode({sides[1], sides[2], sides[3], sides[0]})), 0);
  }
  EXPECT_EQ(half_turn_symmetric, 8);
}

TEST(ArrangementTest, CodesAscendAndAreFound) {
  for (const Arrangement& arrangement : BuiltinArrangements()) {
    EXPECT_TRUE(std::is_sorted(arrangement.codes.begin(), arrangement.codes.end()));
    for (size_t i = 0; i < arrangement.codes.size(); ++i) {
      EXPECT_EQ(arrangement.IndexOfCode(arrangement.codes[i]), static_cast<int>(i));
    }
    EXPECT_EQ(arrangement.IndexOfCode(255), -1);
    EXPECT_EQ(arrangement.IndexOfCode(100000), -1);
  }
}

TEST(ArrangementTest, DigestsArePermanent) {
  // `printf 'plane-16\n160\n..' | sha256sum`. A changed list needs a new id: files in users' hands carry
  // these.
  EXPECT_EQ((*FindArrangement("plane-16"))->sha256,
            "a80b6a32c639e721d1c1a20ec4990ff149c944089674ac878b051af69484ab71");
  EXPECT_EQ((*FindArrangement("surface-96"))->sha256,
            "137cf8cf0c716fba75c24b9d3ea8a10d97f4f1e3586926fcc3a2f29ac18703f4");
  EXPECT_EQ(ArrangementListing(**FindArrangement("plane-16")).substr(0, 17), "plane-16\n160\n161\n");
}

TEST(ArrangementTest, UnknownIdsAreNamed) {
  const auto result = FindArrangement("surface-97");
  EXPECT_EQ(result.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(result.status().message()), testing::HasSubstr("'surface-97'"));
  EXPECT_THAT(std::string(result.status().message()), testing::HasSubstr("plane-16, surface-96"));
}

}  // namespace
}  // namespace tessera
