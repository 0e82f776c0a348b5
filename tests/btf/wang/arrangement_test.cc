#include "btf/wang/arrangement.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(TileCodeTest, FollowsTheFormulaAndInverts) {
  // south 1+, east 0-, north 1-, west 0+: 1 + 2*4 + 3*16 + 0*64.
  EXPECT_EQ(TileCode({TileSide{1, Sign::kPlus}, TileSide{0, Sign::kMinus}, TileSide{1, Sign::kMinus},
                      TileSide{0, Sign::kPlus}},
                     2),
            57u);
  // With three colours, south 2+, east 0-, north 1-, west 2+: 2 + 3*6 + 4*36 + 2*216.
  EXPECT_EQ(TileCode({TileSide{2, Sign::kPlus}, TileSide{0, Sign::kMinus}, TileSide{1, Sign::kMinus},
                      TileSide{2, Sign::kPlus}},
                     3),
            596u);
  for (const int num_colours : {1, 2, 3, 5}) {
    for (uint32_t code = 0; code < static_cast<uint32_t>(16 * std::pow(num_colours, 4)); ++code) {
      EXPECT_EQ(TileCode(SidesFromTileCode(code, num_colours), num_colours), code);
    }
  }
  EXPECT_EQ(TileCode(SidesFromTileCode(4162314255u, kMostColours), kMostColours), 4162314255u);
}

TEST(ArrangementTest, PlanesHaveEveryColouringOfOneSignPattern) {
  for (const auto& [id, num_colours] : {std::pair{"plane-16", 2}, {"plane-81", 3}}) {
    const Arrangement& plane = **FindArrangement(id);
    EXPECT_EQ(plane.num_colours, num_colours);
    ASSERT_EQ(plane.codes.size(), static_cast<size_t>(std::pow(num_colours, 4)));
    EXPECT_FALSE(plane.turned_strips);
    std::set<uint32_t> seen;
    for (size_t tile = 0; tile < plane.codes.size(); ++tile) {
      const TileSides sides = plane.SidesOf(tile);
      EXPECT_EQ(sides[0].sign, Sign::kPlus);
      EXPECT_EQ(sides[1].sign, Sign::kPlus);
      EXPECT_EQ(sides[2].sign, Sign::kMinus);
      EXPECT_EQ(sides[3].sign, Sign::kMinus);
      EXPECT_LT(std::ranges::max(sides, {}, &TileSide::colour).colour, num_colours);
      seen.insert(plane.codes[tile]);
    }
    EXPECT_EQ(seen.size(), plane.codes.size());
  }
  EXPECT_EQ((*FindArrangement("plane-16"))->codes.front(), 160u);  // (0 + 2) * 16 + (0 + 2) * 64
  EXPECT_EQ((*FindArrangement("plane-81"))->codes.front(), 756u);  // (0 + 3) * 36 + (0 + 3) * 216
}

TEST(ArrangementTest, Surface96HasEveryTileOfTwoPlusAndTwoMinus) {
  const Arrangement& surface = **FindArrangement("surface-96");
  ASSERT_EQ(surface.codes.size(), 96u);
  EXPECT_TRUE(surface.turned_strips);
  int half_turn_symmetric = 0;
  for (size_t tile = 0; tile < surface.codes.size(); ++tile) {
    const TileSides sides = surface.SidesOf(tile);
    EXPECT_EQ(std::count_if(sides.begin(), sides.end(), [](auto& s) { return s.sign == Sign::kPlus; }), 2);
    half_turn_symmetric += sides[0] == sides[2] && sides[1] == sides[3];
    // Closed under quarter turns, so any tile may be laid in any turn.
    EXPECT_GE(surface.IndexOfCode(TileCode({sides[1], sides[2], sides[3], sides[0]}, 2)), 0);
  }
  EXPECT_EQ(half_turn_symmetric, 8);
}

TEST(ArrangementTest, Surface26KeepsTheSmallestOfEachOrbitOfSurface96) {
  const Arrangement& surface = **FindArrangement("surface-26");
  EXPECT_TRUE(surface.turned_strips);
  EXPECT_THAT(surface.codes, testing::ElementsAre(10, 11, 14, 15, 26, 27, 30, 31, 34, 35, 38, 39, 41, 45, 51,
                                                  54, 55, 57, 61, 90, 91, 94, 95, 102, 103, 119));
  const Arrangement& whole = **FindArrangement("surface-96");
  std::set<uint32_t> reached;
  for (size_t tile = 0; tile < surface.codes.size(); ++tile) {
    const TileSides s = surface.SidesOf(tile);
    for (const TileSides& turned : {s, TileSides{s[1], s[2], s[3], s[0]}, TileSides{s[2], s[3], s[0], s[1]},
                                    TileSides{s[3], s[0], s[1], s[2]}}) {
      EXPECT_LE(surface.codes[tile], TileCode(turned, 2));
      reached.insert(TileCode(turned, 2));
    }
  }
  EXPECT_THAT(whole.codes, testing::ElementsAreArray(reached));
}

TEST(ArrangementTest, TilesAreShownByTheSmallestTurnThatFits) {
  const Arrangement& surface = **FindArrangement("surface-26");
  for (size_t i = 0; i < (*FindArrangement("surface-96"))->codes.size(); ++i) {
    const TileSides wanted = (*FindArrangement("surface-96"))->SidesOf(i);
    const Arrangement::Laid laid = surface.TileShowing(wanted);
    ASSERT_GE(laid.tile, 0);
    const TileSides own = surface.SidesOf(laid.tile);
    const auto fits = [&](int turns) {
      for (int j = 0; j < 4; ++j) {
        if (!(own[j] == wanted[(j + turns) % 4])) {
          return false;
        }
      }
      return true;
    };
    EXPECT_TRUE(fits(laid.turns));
    for (int less = 0; less < laid.turns; ++less) {
      EXPECT_FALSE(fits(less));
    }
  }
  const TileSides all_plus = {};
  EXPECT_EQ(surface.TileShowing(all_plus).tile, -1);
}

TEST(ArrangementTest, CodesAscendAndAreFound) {
  for (const Arrangement& arrangement : BuiltinArrangements()) {
    EXPECT_TRUE(std::is_sorted(arrangement.codes.begin(), arrangement.codes.end()));
    for (size_t i = 0; i < arrangement.codes.size(); ++i) {
      EXPECT_EQ(arrangement.IndexOfCode(arrangement.codes[i]), static_cast<int>(i));
    }
    EXPECT_EQ(arrangement.IndexOfCode(255), -1);
    EXPECT_EQ(arrangement.IndexOfCode(100000), -1);
    EXPECT_THAT(arrangement.id, testing::EndsWith(absl::StrCat("-", arrangement.codes.size())));
  }
}

TEST(ArrangementTest, DigestsArePermanent) {
  // `printf 'plane-16\n160\n..' | sha256sum`. A changed list needs a new id: files in users' hands carry
  // these.
  EXPECT_EQ((*FindArrangement("plane-16"))->sha256,
            "a80b6a32c639e721d1c1a20ec4990ff149c944089674ac878b051af69484ab71");
  EXPECT_EQ((*FindArrangement("surface-96"))->sha256,
            "137cf8cf0c716fba75c24b9d3ea8a10d97f4f1e3586926fcc3a2f29ac18703f4");
  EXPECT_EQ((*FindArrangement("plane-81"))->sha256,
            "6b5887dc710b64086101e8c38f308c305aca294e8e9d17e9c9bb3e667380f5be");
  EXPECT_EQ((*FindArrangement("surface-26"))->sha256,
            "00fc20aa503ed02d4dbf4ef8efc91a642ff601951271993aa90d7a569b096360");
  EXPECT_EQ(ArrangementListing(**FindArrangement("plane-16")).substr(0, 17), "plane-16\n160\n161\n");
}

TEST(ArrangementTest, UnknownIdsAreNamed) {
  const auto result = FindArrangement("surface-97");
  EXPECT_EQ(result.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(result.status().message()), testing::HasSubstr("'surface-97'"));
  EXPECT_THAT(std::string(result.status().message()), testing::HasSubstr("plane-16, plane-81, surface-26, "));
}

}  // namespace
}  // namespace tessera
