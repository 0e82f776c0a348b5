#include "btf/wang/tile_set_parts.h"

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/sha256.h"
#include "btf/codec/container.h"
#include "btf/codec/container_frame.h"
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
  Container container = *ParseFrame(BytesOf(part));
  change(container);
  return *FrameContainer(std::move(container));
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

// Of an exemplar 20 pixels wide, in blocks of 8x8 pixels: its BTFels lie in three blocks. Tile 4 shows those
// of the first alone.
TileSet SetOfKnownPixels() {
  TileSet tile_set = SmallTileSet("surface-26");
  tile_set.metadata["exemplar"] = {{"width", 20}};
  for (int i = 0; i < 64; ++i) {
    tile_set.tile_index[4 * 64 + i] = PackTexel(i % 2, i % 4);
  }
  return tile_set;
}

// Coefficients 0 to 5 and 11 by two components and a third.
TileSetCut LayeredCutOf(const TileSet& tile_set, std::vector<uint32_t> tiles = {}) {
  const size_t num_blocks = BlocksOf(tile_set.source_pixels, {.width = 20}, 8, 0).size();
  TileSetLayers layers{.block_side = 8, .coefficients = {0, 1, 2, 3, 4, 5, 11}};
  for (int i = 0; i < 12; ++i) {
    layers.mean.push_back(0.1F * static_cast<float>(i));
    layers.scale.push_back(1.0F + static_cast<float>(i));
  }
  TileSetLayer first{.step = 0.25F, .basis_step = {0.01F, 0.5F}};
  first.basis = {1, -2, 3, 0, 500, -6, 7, 0, 0, 1, 1, 0, 0, 0};
  first.codes.assign(2 * 64 * num_blocks, 0);
  TileSetLayer second{.step = 0.01F, .basis_step = {1.0F}};
  second.basis = {1, 2, 3, 4, 5, 6, 0};
  second.codes.assign(3 * 64 * num_blocks, 0);
  for (size_t block = 0; block < num_blocks; ++block) {
    first.codes[block] = 300 * static_cast<int32_t>(block) - 300;
    first.codes[(64 + 5) * num_blocks + block] = static_cast<int32_t>(block % 3) - 1;
    second.codes[(128 + 63) * num_blocks + block] = static_cast<int32_t>(block % 2);
  }
  layers.layers = {std::move(first), std::move(second)};
  TileSetCut cut;
  cut.tiles = std::move(tiles);
  cut.fill.assign(12, 0.0F);
  cut.layers = std::make_shared<const TileSetLayers>(std::move(layers));
  return cut;
}

TEST(TileSetPartsTest, LayersAddUpToTheirSum) {
  const TileSet tile_set = SetOfKnownPixels();
  for (const std::vector<uint32_t>& tiles : {std::vector<uint32_t>{}, {4}, {4, 20}}) {
    const TileSetCut cut = LayeredCutOf(tile_set, tiles);
    const std::vector<std::string> parts = PartsOf(tile_set, cut);
    ASSERT_EQ(parts.size(), 2u);
    LayerSum sum(BlocksOf(tile_set.source_pixels, {.width = 20}, 8, 0), cut.layers->coefficients,
                 cut.layers->mean, cut.layers->scale);
    auto assembler = TileSetAssembler::Begin(BytesOf(parts[0]));
    ASSERT_TRUE(assembler.ok()) << assembler.status();
    EXPECT_EQ(assembler->num_coefficients(), 7u);
    for (size_t part = 0; part < 2; ++part) {
      ASSERT_TRUE(sum.Add(cut.layers->layers[part]).ok());
      if (part == 1) {
        ASSERT_TRUE(assembler->Add(BytesOf(parts[1])).ok());
      }
      const TileSet& got = assembler->tile_set();
      ASSERT_EQ(got.btfels.size(), tiles.size() == 1 ? 2u : got.source_pixels.size());
      EXPECT_EQ(SourceGridOf(got)->width, 20);
      for (const uint32_t tile : tiles.empty() ? std::vector<uint32_t>{4, 20} : tiles) {
        for (int texel = 0; texel < 64; ++texel) {
          const uint32_t whole = tile_set.tile_index[tile * 64 + texel];
          const std::vector<float> expected = sum.Coefficients(std::vector<uint32_t>{BtfelOfTexel(whole)});
          const uint32_t packed = got.tile_index[tile * 64 + texel];
          EXPECT_EQ(TurnsOfTexel(packed), TurnsOfTexel(whole));
          EXPECT_EQ(got.source_pixels[BtfelOfTexel(packed)], tile_set.source_pixels[BtfelOfTexel(whole)]);
          for (int i = 0; i < 12; ++i) {
            const float value =
                got.btfels.offset[i] + got.btfels.step[i] * got.btfels.btfel(BtfelOfTexel(packed))[i];
            ASSERT_NEAR(value, expected[i], 0.501F * got.btfels.step[i] + 1e-4F)
                << part << " " << tile << " " << i;
          }
        }
      }
    }
    EXPECT_TRUE(assembler->is_complete());
  }
}

// Few patches, with lines between them that go on, take few bytes; random texels come back too.
TEST(TileSetPartsTest, PatchesTakeFewBytesAndAllTexelsComeBack) {
  const auto index_bytes = [](const TileSet& tile_set) {
    const std::vector<std::string> parts = PartsOf(tile_set, CutOf(tile_set));
    auto assembler = TileSetAssembler::Begin(BytesOf(parts[0]));
    EXPECT_TRUE(assembler.ok()) << assembler.status();
    EXPECT_EQ(assembler->tile_set().tile_index, tile_set.tile_index);
    return ParseFrame(BytesOf(parts[0]))->Find("tile_patches")->bytes.size();
  };
  TileSet tile_set = SmallTileSet("surface-26");
  tile_set.metadata["exemplar"] = {{"width", 10}};
  for (uint32_t i = 0; i < 50; ++i) {
    tile_set.source_pixels[i] = i;
  }
  const size_t texels = tile_set.tile_index.size();
  EXPECT_GT(index_bytes(tile_set), texels / 2);
  // Of each tile the left half as the exemplar is, the right half turned.
  for (size_t i = 0; i < texels; ++i) {
    const auto x = static_cast<uint32_t>(i % 8);
    const auto y = static_cast<uint32_t>(i / 8 % 8);
    tile_set.tile_index[i] = x < 4 ? PackTexel(y % 5 * 10 + x, 0) : PackTexel((x - 4) * 10 + 9 - y, 1);
  }
  // Rows wrap after the fifth.
  EXPECT_LT(index_bytes(tile_set), texels / 5);
}

TEST(TileSetPartsTest, DamagedLayersAreRefused) {
  const TileSet tile_set = SetOfKnownPixels();
  const std::vector<std::string> parts = PartsOf(tile_set, LayeredCutOf(tile_set));
  const auto begin_fails = [&](const auto& change, const char* what) {
    const auto assembler = TileSetAssembler::Begin(BytesOf(Changed(parts[0], change)));
    EXPECT_FALSE(assembler.ok()) << what;
    EXPECT_THAT(assembler.status().message(), HasSubstr(what));
  };
  const auto set = [](Container& c, const char* name, size_t element, uint32_t bits) {
    PartSection(c, name).bytes.replace(4 * element, 4, reinterpret_cast<const char*>(&bits), 4);
  };
  begin_fails([&](Container& c) { set(c, "layer_step", 0, 0); }, "step 0");
  begin_fails([&](Container& c) { set(c, "layer_step", 0, 0x7fc00000); }, "step nan");
  begin_fails([&](Container& c) { set(c, "basis_step", 1, 0xbf800000); }, "basis_step");
  begin_fails([&](Container& c) { set(c, "basis_step", 0, 0x7f7fffff); }, "coefficients up to");
  begin_fails([&](Container& c) { set(c, "coefficients", 1, 0); }, "'coefficients': 0 of 12");
  begin_fails([&](Container& c) { set(c, "coefficients", 1, 12); }, "'coefficients': 12 of 12");
  begin_fails([&](Container& c) { set(c, "reach", 0, 65); }, "'reach': 2 values");
  begin_fails([&](Container& c) { set(c, "scale", 3, 0x7f800000); }, "'scale'");
  begin_fails(
      [](Container& c) {
        Section& codes = PartSection(c, "codes");
        codes.bytes += "left";
        codes.shape[0] += 4;
      },
      "section 'codes': the numbers end");
  begin_fails([](Container& c) { c.header["block_side"] = 129; }, "block_side");
  begin_fails([](Container& c) { c.header["block_side"] = 0; }, "block_side");
  begin_fails([](Container& c) { c.header.erase("block_side"); }, "block_side");
  begin_fails([](Container& c) { c.header["level"] = 13; }, "level");
  begin_fails([](Container& c) { c.header["exemplar_width"] = 0; }, "exemplar_width");
  begin_fails([](Container& c) { c.header["footprint"] = -1; }, "footprint");
  begin_fails([](Container& c) { c.header["tile_size"] = 5000; }, "tile_size");
  begin_fails(
      [](Container& c) {
        Section& patches = PartSection(c, "tile_patches");
        patches.bytes.assign(patches.bytes.size(), '\0');
      },
      "tile_patches");

  auto assembler = TileSetAssembler::Begin(BytesOf(parts[0]));
  ASSERT_TRUE(assembler.ok());
  const std::string damaged = Changed(parts[1], [&](Container& c) { set(c, "layer_step", 0, 0); });
  EXPECT_FALSE(assembler->Add(BytesOf(damaged)).ok());
  EXPECT_EQ(assembler->num_parts(), 1u);
  EXPECT_TRUE(assembler->Add(BytesOf(parts[1])).ok());
}

// Coefficients 8 and 3 as they are, all others coarse by one component, then as they are.
TEST(TileSetPartsTest, LayersComeBetweenExactCoefficients) {
  const TileSet tile_set = SmallTileSet("surface-26");
  TileSetCut cut;
  cut.tiles = {2, 7};
  cut.order = {8, 3, 0, 1, 2, 4, 5, 6, 7, 9, 10, 11};
  cut.ends = {2, 6, 12};
  cut.fill.assign(12, 0.5F);
  TileSetLayers layers;
  layers.mean.assign(12, 2.0F);
  layers.scale.assign(12, 1.0F);
  layers.coefficients = {0, 1, 2, 4, 5, 6, 7, 9, 10, 11};
  TileSetLayer layer{.step = 1.0F, .basis_step = {1.0F}};
  layer.basis.assign(10, 1);
  for (int btfel = 0; btfel < 50; ++btfel) {
    layer.codes.push_back(btfel);
  }
  layers.layers = {layer};
  cut.layers = std::make_shared<const TileSetLayers>(layers);
  const std::vector<std::string> parts = PartsOf(tile_set, cut);
  ASSERT_EQ(parts.size(), 4u);
  auto assembler = TileSetAssembler::Begin(BytesOf(parts[0]));
  ASSERT_TRUE(assembler.ok()) << assembler.status();
  EXPECT_EQ(assembler->num_coefficients(), 2u);
  const auto value = [&](int tile, int coefficient) {
    const BtfelTable& now = assembler->tile_set().btfels;
    return now.offset[coefficient] +
           now.step[coefficient] *
               now.btfel(BtfelOfTexel(assembler->tile_set().texel(tile, 3, 4)))[coefficient];
  };
  const uint32_t shown = BtfelOfTexel(tile_set.texel(7, 3, 4));
  const auto exact = [&](int coefficient) {
    return tile_set.btfels.offset[coefficient] +
           tile_set.btfels.step[coefficient] * tile_set.btfels.btfel(shown)[coefficient];
  };
  EXPECT_EQ(value(7, 8), exact(8));
  EXPECT_EQ(value(7, 9), 0.5F);
  ASSERT_TRUE(assembler->Add(BytesOf(parts[1])).ok());
  EXPECT_EQ(assembler->num_coefficients(), 12u);
  EXPECT_EQ(value(7, 8), exact(8));
  EXPECT_NEAR(value(7, 9), 2.0F + static_cast<float>(shown), 0.2F);
  ASSERT_TRUE(assembler->Add(BytesOf(parts[2])).ok());
  EXPECT_EQ(value(7, 4), exact(4));
  EXPECT_NEAR(value(7, 9), 2.0F + static_cast<float>(shown), 0.2F);
  EXPECT_FALSE(assembler->Add(BytesOf(parts[2])).ok());
  ASSERT_TRUE(assembler->Add(BytesOf(parts[3])).ok());
  EXPECT_EQ(value(7, 9), exact(9));
  EXPECT_TRUE(assembler->is_complete());
}

TEST(TileSetPartsTest, CutsIntoLayersAreChecked) {
  const TileSet tile_set = SetOfKnownPixels();
  const auto refused = [&](const auto& change, const char* what) {
    TileSetCut cut = LayeredCutOf(tile_set);
    TileSetLayers layers = *cut.layers;
    change(layers);
    cut.layers = std::make_shared<const TileSetLayers>(std::move(layers));
    const absl::Status status = TileSetCutter::Create(tile_set, std::move(cut)).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << what;
    EXPECT_THAT(status.message(), HasSubstr(what));
  };
  refused([](TileSetLayers& layers) { layers.mean.pop_back(); }, "mean of 11");
  refused([](TileSetLayers& layers) { layers.coefficients[0] = 1; }, "coefficient 1 of 12");
  refused([](TileSetLayers& layers) { layers.bases.emplace().mean = {1.0F}; }, "1 means");
  refused([](TileSetLayers& layers) { layers.layers[1].cores = {1}; }, "no bases");
  refused([](TileSetLayers& layers) { layers.block_side = 0; }, "blocks of side 0");
  refused([](TileSetLayers& layers) { layers.block_side = 7; }, "images: 384 of ");
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
