#include "btf/wang/tile_set_parts.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/sha256.h"
#include "btf/codec/container.h"
#include "btf/wang/dress.h"
#include "btf/wang/redress.h"
#include "btf/wang/scene_needs.h"
#include "btf/wang/shapes.h"
#include "tests/btf/wang/small_tile_set.h"

namespace tessera {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::span<const std::byte> BytesOf(const std::string& text) {
  return std::as_bytes(std::span(text));
}

TileSetCut CutOf(const TileSet& tile_set, std::vector<uint32_t> tiles = {}) {
  TileSetCut cut;
  cut.tiles = std::move(tiles);
  for (int i = tile_set.btfels.num_coefficients - 1; i >= 0; --i) {
    cut.order.push_back(static_cast<uint32_t>(i));
    cut.fill.push_back(0.25F);
  }
  cut.ends = {3, 7, 12};
  cut.origin = {{"level", 0}};
  return cut;
}

std::vector<std::string> PartsOf(const TileSet& tile_set, const TileSetCut& cut) {
  const auto cutter = TileSetCutter::Create(tile_set, cut);
  EXPECT_TRUE(cutter.ok()) << cutter.status();
  std::vector<std::string> parts = {cutter->Part(0, "").value()};
  for (size_t i = 1; i < cutter->num_parts(); ++i) {
    parts.push_back(cutter->Part(i, Sha256Hex(BytesOf(parts[0]))).value());
  }
  return parts;
}

TEST(TileSetPartsTest, AllPartsTogetherAreTheTileSet) {
  const TileSet tile_set = SmallTileSet("surface-26");
  const std::vector<std::string> parts = PartsOf(tile_set, CutOf(tile_set));
  auto assembler = TileSetAssembler::Begin(BytesOf(parts[0]));
  ASSERT_TRUE(assembler.ok()) << assembler.status();
  EXPECT_FALSE(assembler->is_complete());
  // Coefficient 11 came, 0 did not.
  const BtfelTable& now = assembler->tile_set().btfels;
  EXPECT_EQ(now.btfel(4)[11], tile_set.btfels.btfel(4)[11]);
  EXPECT_EQ(now.offset[0], 0.25F);
  EXPECT_EQ(now.step[0], 0.0F);
  ASSERT_TRUE(assembler->Add(BytesOf(parts[1])).ok());
  ASSERT_TRUE(assembler->Add(BytesOf(parts[2])).ok());
  EXPECT_TRUE(assembler->is_complete());
  const TileSet& whole = assembler->tile_set();
  EXPECT_EQ(whole.tile_index, tile_set.tile_index);
  EXPECT_EQ(whole.source_pixels, tile_set.source_pixels);
  EXPECT_EQ(whole.btfels.codes, tile_set.btfels.codes);
  EXPECT_EQ(whole.btfels.offset, tile_set.btfels.offset);
  EXPECT_EQ(whole.btfels.step, tile_set.btfels.step);
  EXPECT_EQ(whole.provenance.source, tile_set.provenance.source);
  EXPECT_EQ(whole.radiometry, tile_set.radiometry);
  EXPECT_FALSE(TilesHeld(whole).has_value());
}

TEST(TileSetPartsTest, OnlyTheTilesAskedForComeAndOnlyTheirBtfels) {
  TileSet tile_set = SmallTileSet("surface-96");
  for (int i = 0; i < 64; ++i) {
    tile_set.tile_index[5 * 64 + i] = PackTexel(static_cast<uint32_t>(30 + i % 4), i % 3);
    tile_set.tile_index[9 * 64 + i] = PackTexel(static_cast<uint32_t>(7), 1);
  }
  const std::vector<std::string> parts = PartsOf(tile_set, CutOf(tile_set, {5, 9}));
  auto assembler = TileSetAssembler::Begin(BytesOf(parts[0]));
  ASSERT_TRUE(assembler.ok()) << assembler.status();
  const TileSet& some = assembler->tile_set();
  EXPECT_EQ(some.btfels.size(), 5u);
  EXPECT_THAT(some.source_pixels, ElementsAre(22, 91, 94, 97, 100));
  EXPECT_EQ(some.texel(5, 1, 0), PackTexel(2, 1));
  EXPECT_EQ(some.texel(9, 3, 3), PackTexel(0, 1));
  EXPECT_EQ(some.btfels.btfel(2)[10], tile_set.btfels.btfel(31)[10]);
  EXPECT_THAT(TilesHeld(some).value(), ElementsAre(5, 9));
  // The record survives a file.
  const auto file = SerializeTileSet(some);
  ASSERT_TRUE(file.ok()) << file.status();
  const auto parsed = ParseTileSet(BytesOf(*file));
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_THAT(TilesHeld(*parsed).value(), ElementsAre(5, 9));

  const Arrangement& arrangement = **FindArrangement("surface-96");
  auto dressed = DressMesh(*BuiltinShape("torus"), arrangement, {}, {});
  ASSERT_TRUE(dressed.ok());
  const auto refused = Redress(dressed->dressing, *parsed);
  EXPECT_TRUE(absl::IsFailedPrecondition(refused.status()));
  EXPECT_THAT(refused.status().message(), HasSubstr("not among the 2 of 96 tiles"));
  std::ranges::fill(dressed->dressing.tile, 9u);
  EXPECT_TRUE(Redress(dressed->dressing, *parsed).ok());
}

TEST(TileSetPartsTest, PartsComeInOrderAndFromOneSet) {
  const TileSet tile_set = SmallTileSet("surface-26");
  const std::vector<std::string> parts = PartsOf(tile_set, CutOf(tile_set));
  const std::vector<std::string> others = PartsOf(tile_set, CutOf(tile_set, {1, 2}));
  EXPECT_TRUE(absl::IsFailedPrecondition(TileSetAssembler::Begin(BytesOf(parts[1])).status()));
  auto assembler = TileSetAssembler::Begin(BytesOf(parts[0]));
  ASSERT_TRUE(assembler.ok());
  for (const std::string& wrong : {parts[0], parts[2], others[1]}) {
    EXPECT_FALSE(assembler->Add(BytesOf(wrong)).ok());
    EXPECT_EQ(assembler->num_coefficients(), 3u);
  }
  ASSERT_TRUE(assembler->Add(BytesOf(parts[1])).ok());
  EXPECT_FALSE(assembler->Add(BytesOf(parts[1])).ok());
  ASSERT_TRUE(assembler->Add(BytesOf(parts[2])).ok());
}

// Changes one thing in a part and writes it again, checksums and all.
template <typename Change>
std::string Changed(const std::string& part, const Change& change) {
  Container container = *ParseContainer(BytesOf(part));
  change(container);
  return *SerializeContainer(std::move(container));
}

Section& PartSection(Container& container, std::string_view name) {
  return container.sections[static_cast<size_t>(container.Find(name) - container.sections.data())];
}

TEST(TileSetPartsTest, DamagedPartsAreRefused) {
  const TileSet tile_set = SmallTileSet("surface-26");
  const std::vector<std::string> parts = PartsOf(tile_set, CutOf(tile_set));
  for (size_t size = 0; size < parts[0].size(); size += 97) {
    EXPECT_FALSE(TileSetAssembler::Begin(BytesOf(parts[0].substr(0, size))).ok()) << size;
  }
  const auto begin_fails = [&](const auto& change, const char* what) {
    const auto assembler = TileSetAssembler::Begin(BytesOf(Changed(parts[0], change)));
    EXPECT_FALSE(assembler.ok()) << what;
    EXPECT_THAT(assembler.status().message(), HasSubstr(what));
  };
  begin_fails([](Container& c) { c.header["arrangement"]["sha256"] = std::string(64, '0'); }, "sha256");
  begin_fails(
      [](Container& c) {
        c.header["codec"]["tables"]["basis_light"]["shape"] = {1 << 20, 1 << 20};
      },
      "basis_light");
  begin_fails([](Container& c) { PartSection(c, "coefficients").bytes[0] = 12; }, "12 of 12");
  begin_fails([](Container& c) { PartSection(c, "fill").bytes.replace(0, 4, "\x00\x00\xc0\x7f", 4); },
              "fill");
  begin_fails([](Container& c) { PartSection(c, "step").bytes[3] = '\xbf'; }, "step");
  begin_fails(
      [](Container& c) {
        Section& codes = PartSection(c, "btfels.0");
        codes.shape[0] -= 1;
        codes.bytes.resize(codes.bytes.size() - 3);
      },
      "btfels.0");
  begin_fails([](Container& c) { c.header.erase("codec"); }, "");

  auto assembler = TileSetAssembler::Begin(BytesOf(parts[0]));
  ASSERT_TRUE(assembler.ok());
  const std::string repeated =
      Changed(parts[1], [](Container& c) { PartSection(c, "coefficients").bytes[0] = 11; });
  EXPECT_FALSE(assembler->Add(BytesOf(repeated)).ok());
  EXPECT_EQ(assembler->tile_set().btfels.size(), 50u);
  EXPECT_TRUE(assembler->Add(BytesOf(parts[1])).ok());
}

TEST(SceneNeedsTest, FollowFromADressingAndItsSize) {
  Dressing dressing;
  dressing.tile = {7, 3, 7, 90, 3};
  EXPECT_THAT(NeedsOfDressing(dressing).tiles, ElementsAre(3, 7, 90));
  EXPECT_EQ(LevelForPixels(64, 64.0).value(), 0);
  EXPECT_EQ(LevelForPixels(64, 1000.0).value(), 0);
  EXPECT_EQ(LevelForPixels(64, 8.0).value(), 2);
  EXPECT_EQ(LevelForPixels(64, 5.6).value(), 3);
  EXPECT_EQ(LevelForPixels(64, 0.001).value(), 6);
  EXPECT_EQ(LevelForPixels(36, 1.0).value(), 2);
  EXPECT_EQ(LevelForPixels(64, 23.0).value(), 0);
  for (const double pixels : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_TRUE(absl::IsInvalidArgument(LevelForPixels(64, pixels).status())) << pixels;
  }
}

TEST(SceneNeedsTest, AreCheckedByName) {
  const auto refused = [](const SceneNeeds& needs, const char* what) {
    const absl::Status status = CheckNeeds(needs, 96, 64);
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << what;
    EXPECT_THAT(status.message(), HasSubstr(what));
  };
  EXPECT_TRUE(CheckNeeds({.tiles = {0, 95}, .level = 6, .max_error = 0.0, .max_bytes = 1}, 96, 64).ok());
  refused({.tiles = {96}}, "tile 96: the tile set has tiles 0 to 95");
  refused({.level = 7}, "levels 0 to 6");
  refused({.level = -1}, "levels 0 to 6");
  refused({.max_error = -0.1}, "max_error -0.1");
  refused({.max_error = std::nan("")}, "max_error nan");
  refused({.max_error = INFINITY}, "max_error inf");
  refused({.max_bytes = 0}, "max_bytes 0");
}

}  // namespace
}  // namespace tessera
