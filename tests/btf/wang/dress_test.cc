#include "btf/wang/dress.h"

#include <algorithm>
#include <array>
#include <map>
#include <numeric>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/wang/edge_signs.h"
#include "btf/wang/frame_field.h"
#include "btf/wang/mesh_topology.h"
#include "btf/wang/neighbour.h"
#include "btf/wang/shapes.h"
#include "tests/btf/wang/meshes.h"

namespace tessera {
namespace {

DressResult Dress(const QuadMesh& mesh, std::string_view arrangement, const DressParams& params = {}) {
  auto result = DressMesh(mesh, **FindArrangement(arrangement), params, RunContext{});
  EXPECT_TRUE(result.ok()) << result.status();
  return result.ok() ? *std::move(result) : DressResult{};
}

// What a side of a face shows, straight from the definition: tile side j lies on face side (j + turns) mod 4.
std::map<int, TileSide> ShownSides(const Dressing& dressing, const Arrangement& arrangement, size_t face) {
  const TileSides tile = arrangement.SidesOf(dressing.tile.at(face));
  std::map<int, TileSide> shown;
  for (int j = 0; j < 4; ++j) {
    shown[(j + dressing.turns.at(face)) % 4] = tile[j];
  }
  return shown;
}

// Every quad has a tile, and across every edge, found by comparing vertices, there is one colour and two
// signs.
void ExpectLegal(const Dressing& dressing, const Arrangement& arrangement) {
  ASSERT_EQ(dressing.tile.size(), dressing.mesh.quads.size());
  ASSERT_EQ(dressing.turns.size(), dressing.mesh.quads.size());
  std::map<std::pair<uint32_t, uint32_t>, std::pair<size_t, TileSide>> open;
  for (size_t face = 0; face < dressing.mesh.quads.size(); ++face) {
    ASSERT_LT(dressing.tile[face], arrangement.codes.size());
    ASSERT_LT(dressing.turns[face], 4);
    const auto shown = ShownSides(dressing, arrangement, face);
    for (int k = 0; k < 4; ++k) {
      const uint32_t a = dressing.mesh.quads[face][k];
      const uint32_t b = dressing.mesh.quads[face][(k + 1) % 4];
      if (const auto other = open.find({b, a}); other != open.end()) {
        EXPECT_EQ(other->second.second.colour, shown.at(k).colour)
            << "faces " << other->second.first << ", " << face;
        EXPECT_NE(other->second.second.sign, shown.at(k).sign)
            << "faces " << other->second.first << ", " << face;
        open.erase(other);
      } else {
        EXPECT_TRUE(open.emplace(std::pair{a, b}, std::pair{face, shown.at(k)}).second) << "edge used twice";
      }
    }
  }
}

TEST(DressMeshTest, EveryShapeHasLegalNeighboursOnASurfaceArrangement) {
  for (const std::string_view shape : BuiltinShapeNames()) {
    const DressResult result = Dress(*BuiltinShape(shape), "surface-96");
    EXPECT_TRUE(result.breaks.empty());
    ExpectLegal(result.dressing, **FindArrangement("surface-96"));
    EXPECT_TRUE(std::all_of(result.dressing.turns.begin(), result.dressing.turns.end(), [](uint8_t turns) {
      return turns == 0;
    })) << "all 96 codes are there, so the smallest fitting turn is 0";
  }
}

// The colours and signs depend on mesh and seed alone, so surface-26 shows what surface-96 shows.
TEST(DressMeshTest, Surface26ShowsEverySideThatSurface96Shows) {
  const Arrangement& few = **FindArrangement("surface-26");
  const Arrangement& all = **FindArrangement("surface-96");
  const auto expect_same_sides = [&](const QuadMesh& mesh, const DressParams& params) {
    const DressResult result = Dress(mesh, "surface-26", params);
    EXPECT_TRUE(result.breaks.empty());
    ExpectLegal(result.dressing, few);
    const Dressing whole = Dress(mesh, "surface-96", params).dressing;
    for (size_t face = 0; face < whole.tile.size(); ++face) {
      EXPECT_EQ(ShownSides(result.dressing, few, face), ShownSides(whole, all, face));
    }
    return std::set<uint8_t>(result.dressing.turns.begin(), result.dressing.turns.end());
  };
  for (const std::string_view shape : BuiltinShapeNames()) {
    EXPECT_EQ(expect_same_sides(*BuiltinShape(shape), {}).size(), 4u) << "tiles in every turn";
  }
  for (uint64_t seed = 0; seed < 20; ++seed) {
    expect_same_sides(RandomPolycube(seed), {.seed = seed, .target_quads = 1});
  }
  expect_same_sides(Strip(9, 3, Closing::kBand), {});
}

TEST(DressMeshTest, OpenAndClosedAndRandomMeshesHaveLegalNeighbours) {
  ExpectLegal(Dress(Cube(), "surface-96", {.target_quads = 6}).dressing, **FindArrangement("surface-96"));
  ExpectLegal(Dress(Strip(1, 1, Closing::kOpen), "surface-96", {.target_quads = 1}).dressing,
              **FindArrangement("surface-96"));
  ExpectLegal(Dress(Strip(3, 2, Closing::kOpen), "surface-96", {.target_quads = 1}).dressing,
              **FindArrangement("surface-96"));
  ExpectLegal(Dress(Strip(9, 3, Closing::kBand), "surface-96").dressing, **FindArrangement("surface-96"));
  for (uint64_t seed = 0; seed < 40; ++seed) {
    const QuadMesh mesh = RandomPolycube(seed);
    const DressResult result = Dress(mesh, "surface-96", {.seed = seed, .target_quads = 1});
    EXPECT_EQ(result.dressing.mesh.quads.size(), mesh.quads.size());
    ExpectLegal(result.dressing, **FindArrangement("surface-96"));
  }
}

// Of the tiles' counts against equal ones.
double ChiSquareOfTiles(const Dressing& dressing, size_t num_tiles) {
  std::vector<double> counts(num_tiles, 0.0);
  for (const uint32_t tile : dressing.tile) {
    ++counts[tile];
  }
  const double expected = static_cast<double>(dressing.tile.size()) / static_cast<double>(num_tiles);
  double chi_square = 0.0;
  for (const double count : counts) {
    chi_square += (count - expected) * (count - expected) / expected;
  }
  return chi_square;
}

TEST(DressMeshTest, UsesAllTilesAboutEquallyOften) {
  const DressResult result = Dress(*BuiltinShape("torus"), "surface-96", {.target_quads = 19200});
  // Tiles of neighbours are not independent, so this is a bound on the spread and no test of chance: four
  // times the 99.9% quantile at 95 and 80 degrees of freedom.
  EXPECT_LT(ChiSquareOfTiles(result.dressing, 96), 4 * 143.3);
  const DressResult plane = Dress(*BuiltinShape("torus"), "plane-81", {.target_quads = 19200});
  EXPECT_LT(ChiSquareOfTiles(plane.dressing, 81), 4 * 124.8);
}

TEST(DressMeshTest, SameSeedSameDressingAndAnotherSeedAnother) {
  const QuadMesh mesh = *BuiltinShape("genus3");
  const Dressing a = Dress(mesh, "surface-96", {.seed = 5}).dressing;
  const Dressing b = Dress(mesh, "surface-96", {.seed = 5}).dressing;
  const Dressing c = Dress(mesh, "surface-96", {.seed = 6}).dressing;
  EXPECT_EQ(a.tile, b.tile);
  EXPECT_EQ(a.turns, b.turns);
  EXPECT_NE(a.tile, c.tile);
  EXPECT_EQ(a.source_mesh_sha256, QuadMeshSha256(mesh));
}

TEST(DressMeshTest, ADressingIsTheSameOnEveryMachineAndInEveryVersion) {
  // The first tiles of the plane at seed 1. Dressings in users' hands were made so; this list never changes.
  const Dressing surface = Dress(*BuiltinShape("plane"), "surface-96").dressing;
  const Dressing plane = Dress(*BuiltinShape("plane"), "plane-16").dressing;
  ASSERT_GE(std::min(surface.tile.size(), plane.tile.size()), 8u);
  EXPECT_THAT(std::vector<uint32_t>(surface.tile.begin(), surface.tile.begin() + 8),
              testing::ElementsAre(30, 35, 79, 34, 85, 13, 9, 50));
  EXPECT_THAT(std::vector<uint32_t>(plane.tile.begin(), plane.tile.begin() + 8),
              testing::ElementsAre(14, 11, 11, 10, 13, 1, 1, 2));
  const Dressing turned = Dress(*BuiltinShape("plane"), "surface-26").dressing;
  const Dressing three_colours = Dress(*BuiltinShape("plane"), "plane-81").dressing;
  EXPECT_THAT(std::vector<uint32_t>(turned.tile.begin(), turned.tile.begin() + 8),
              testing::ElementsAre(21, 24, 16, 23, 24, 12, 9, 4));
  EXPECT_THAT(std::vector<uint8_t>(turned.turns.begin(), turned.turns.begin() + 8),
              testing::ElementsAre(0, 0, 3, 0, 3, 0, 0, 3));
  EXPECT_THAT(std::vector<uint32_t>(three_colours.tile.begin(), three_colours.tile.begin() + 8),
              testing::ElementsAre(56, 7, 73, 17, 78, 59, 49, 46));
}

using ShapeAndArrangement = std::pair<const char*, const char*>;

TEST(DressMeshTest, PlaneAndTorusTakePlanesWithoutBreaks) {
  for (const auto& [shape, id] : std::vector<ShapeAndArrangement>{
           {"plane", "plane-16"}, {"torus", "plane-16"}, {"torus", "plane-81"}}) {
    const DressResult result = Dress(*BuiltinShape(shape), id, {.target_quads = 1000});
    EXPECT_TRUE(result.breaks.empty());
    ExpectLegal(result.dressing, **FindArrangement(id));
    const auto neighbours = BuildTileNeighbours(result.dressing);
    for (const auto& sides : *neighbours) {
      for (const TileNeighbour& across : sides) {
        EXPECT_TRUE(across.face < 0 || across.turns == 0) << "unturned strips need one frame";
      }
    }
  }
}

TEST(DressMeshTest, FindsAConsistentFrameHoweverTheFacesStart) {
  QuadMesh mesh = *BuiltinShape("torus");
  Rng rng(3);
  for (Quad& quad : mesh.quads) {
    std::rotate(quad.begin(), quad.begin() + static_cast<std::ptrdiff_t>(rng.NextBelow(4)), quad.end());
  }
  const DressResult result = Dress(mesh, "plane-16", {.target_quads = 1});
  EXPECT_TRUE(result.breaks.empty());
  ExpectLegal(result.dressing, **FindArrangement("plane-16"));
}

TEST(DressMeshTest, BreaksOfPlane16AreRefusedOrListed) {
  const QuadMesh cube = Cube();
  const auto refused = DressMesh(cube, **FindArrangement("plane-16"), {.target_quads = 6}, RunContext{});
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(refused.status().message()),
              testing::HasSubstr("plane-16 needs one consistent frame"));
  EXPECT_THAT(std::string(refused.status().message()), testing::HasSubstr("edge between vertices"));

  const DressResult result = Dress(cube, "plane-16", {.allow_breaks = true, .target_quads = 6});
  // Each of the cube's eight corners is the end of at least one broken edge, an edge has two ends.
  EXPECT_GE(result.breaks.size(), 4u);
  EXPECT_LE(result.breaks.size(), 7u);  // the 12 edges less a tree over the 6 faces
  EXPECT_EQ(result.dressing.metadata["num_breaks"], result.breaks.size());
  EXPECT_EQ(result.dressing.metadata["breaks"].size(), result.breaks.size());
  const QuadAdjacency adjacency = *BuildAdjacency(result.dressing.mesh);
  for (const Break& broken : result.breaks) {
    EXPECT_LT(broken.face, broken.other_face);
    EXPECT_EQ(adjacency.across[broken.face][broken.side].face, static_cast<int>(broken.other_face));
    EXPECT_EQ(adjacency.across[broken.face][broken.side].side, broken.other_side);
  }
}

TEST(DressMeshTest, RefusesWhatItCannotDressByName) {
  const auto message = [](const QuadMesh& mesh, const DressParams& params = {}) {
    return std::string(
        DressMesh(mesh, **FindArrangement("surface-96"), params, RunContext{}).status().message());
  };
  EXPECT_THAT(message(QuadMesh{}), testing::HasSubstr("no faces"));
  EXPECT_THAT(message(Strip(8, 1, Closing::kMoebius)), testing::HasSubstr("same direction along the edge"));
  EXPECT_THAT(message(Cube(), {.target_quads = 1u << 30}), testing::HasSubstr("limit is 4194304"));
  QuadMesh broken = Cube();
  broken.positions[3].x() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(message(broken), testing::HasSubstr("vertex 4: the position is not finite"));
}

TEST(DressMeshTest, StopsWhenAskedTo) {
  std::stop_source stop;
  RunContext context;
  context.stop = stop.get_token();
  stop.request_stop();
  EXPECT_EQ(DressMesh(Cube(), **FindArrangement("surface-96"), {}, context).status().code(),
            absl::StatusCode::kCancelled);
}

TEST(FindBreaksTest, NoticesAWrongTile) {
  Dressing dressing = Dress(*BuiltinShape("torus"), "surface-96").dressing;
  EXPECT_TRUE(FindBreaks(dressing, **FindArrangement("surface-96"))->empty());
  const TileSides sides = (*FindArrangement("surface-96"))->SidesOf(dressing.tile[7]);
  TileSides wrong = sides;
  wrong[1].colour ^= 1;
  dressing.tile[7] = static_cast<uint32_t>((*FindArrangement("surface-96"))->IndexOfCode(TileCode(wrong, 2)));
  EXPECT_EQ(FindBreaks(dressing, **FindArrangement("surface-96"))->size(), 1u);
  dressing.tile[7] = 96;
  EXPECT_EQ(FindBreaks(dressing, **FindArrangement("surface-96")).status().code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(EulerSignsTest, TwoOfEachInEveryQuadAndOneOfEachOnEveryEdge) {
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const QuadAdjacency adjacency = *BuildAdjacency(RandomPolycube(seed));
    const auto signs = EulerSigns(adjacency, seed);
    for (size_t face = 0; face < signs.size(); ++face) {
      EXPECT_EQ(std::count(signs[face].begin(), signs[face].end(), Sign::kPlus), 2);
      for (int k = 0; k < 4; ++k) {
        const auto& across = adjacency.across[face][k];
        EXPECT_NE(signs[face][k], signs[across.face][across.side]);
      }
    }
  }
}

TEST(FrameFieldTest, ContinuesAFrameAcrossEveryPairOfSides) {
  for (uint8_t turns = 0; turns < 4; ++turns) {
    for (int k = 0; k < 4; ++k) {
      for (int j = 0; j < 4; ++j) {
        // The tile side of f on its side k is opposite to that of g on its side j.
        const int of_f = (k - turns) & 3;
        const int of_g = (j - ContinuedTurns(turns, k, j)) & 3;
        EXPECT_EQ((of_f + 2) & 3, of_g);
      }
    }
  }
}

size_t NumBreaks(const QuadMesh& mesh) {
  const QuadAdjacency adjacency = *BuildAdjacency(mesh);
  const std::vector<uint8_t> turns = ConsistentTurns(adjacency);
  size_t sides = 0;
  for (size_t face = 0; face < turns.size(); ++face) {
    for (int k = 0; k < 4; ++k) {
      const auto& across = adjacency.across[face][k];
      sides += turns[across.face] != ContinuedTurns(turns[face], k, across.side);
    }
  }
  return sides / 2;
}

TEST(FrameFieldTest, BreaksAsLittleAsACubeDoes) {
  // The eight corners of the cube turn the frame by a quarter each, so that trees of breaks join four of them
  // at least: three edges of the cube for each tree.
  const auto cube = BuiltinShape("cube-sphere");
  const auto side =
      static_cast<size_t>(std::lround(std::sqrt(static_cast<double>(cube->quads.size()) / 6.0)));
  EXPECT_EQ(NumBreaks(*cube), 2 * 3 * side);
}

TEST(FrameFieldTest, FindsWhatSingleQuadsDoNot) {
  // More break where the frame is spread from the first quad and single quads are turned while that helps.
  EXPECT_LE(NumBreaks(*BuiltinShape("genus3")), 20U);
}

TEST(TileNeighbourTest, TurnsAreThoseSeenInTheFirstTilesFrame) {
  // Two quads side by side, the right one starting at another corner and laid with other turns. Points of the
  // right tile are laid out in the plane and compared.
  for (uint32_t start = 0; start < 4; ++start) {
    for (uint8_t left_turns = 0; left_turns < 4; ++left_turns) {
      for (uint8_t right_turns = 0; right_turns < 4; ++right_turns) {
        Dressing dressing;
        dressing.mesh = Strip(2, 1, Closing::kOpen);
        std::rotate(dressing.mesh.quads[1].begin(), dressing.mesh.quads[1].begin() + start,
                    dressing.mesh.quads[1].end());
        dressing.turns = {left_turns, right_turns};
        const auto neighbours = *BuildTileNeighbours(dressing);
        // East of the left quad, as a side of its tile.
        const int tile_side = (1 - left_turns) & 3;
        const TileNeighbour& across = neighbours[0][tile_side];
        EXPECT_EQ(across.face, 1);
        // The right tile's frame in the plane: its face's side 0 starts at corner `start`, its tile side j
        // lies on face side j + right_turns; so its tile side 0 is the plane's side start + right_turns, as
        // is the left's left_turns. Both are turned by that many quarter turns.
        const int turns_in_plane = static_cast<int>(start) + right_turns;
        EXPECT_EQ(across.turns, (turns_in_plane - left_turns) & 3);
        EXPECT_EQ((across.side + turns_in_plane) & 3, 3) << "it lies west of the right quad";
        EXPECT_EQ(neighbours[1][across.side].face, 0);
        EXPECT_EQ((neighbours[1][across.side].turns + across.turns) & 3, 0);
      }
    }
  }
}

TEST(TileNeighbourTest, TexelsOnSidesRunCounterClockwise) {
  constexpr int kW = 5;
  const auto at = [](int s, int p, int d) {
    const TexelPosition texel = TexelOnSide(s, p, d, kW);
    return std::pair(texel.x, texel.y);
  };
  EXPECT_EQ(at(0, 0, 0), std::pair(0, 4));
  EXPECT_EQ(at(0, 4, 1), std::pair(4, 3));
  EXPECT_EQ(at(1, 0, 0), std::pair(4, 4));
  EXPECT_EQ(at(2, 0, 0), std::pair(4, 0));
  EXPECT_EQ(at(3, 0, 0), std::pair(0, 0));
  EXPECT_EQ(at(3, 4, 2), std::pair(2, 4));
}

}  // namespace
}  // namespace tessera
