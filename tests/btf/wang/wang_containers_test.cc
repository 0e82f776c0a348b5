// Tile sets and dressings as bytes.
#include <cstring>
#include <functional>
#include <limits>
#include <span>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/sha256.h"
#include "btf/codec/container.h"
#include "btf/wang/dress.h"
#include "btf/wang/dressing.h"
#include "btf/wang/shapes.h"
#include "btf/wang/tile_set.h"
#include "tests/btf/wang/meshes.h"
#include "tests/btf/wang/small_tile_set.h"

namespace tessera {
namespace {

using testing::HasSubstr;

std::span<const std::byte> Bytes(const std::string& text) {
  return std::as_bytes(std::span(text));
}

Dressing SmallDressing() {
  return DressMesh(Cube(), **FindArrangement("surface-96"), {.seed = ~uint64_t{0}, .target_quads = 24},
                   RunContext{})
      ->dressing;
}

// The container, changed behind the back of the writer.
std::string Changed(const std::string& bytes, const std::function<void(Container&)>& change) {
  Container container = *ParseContainer(Bytes(bytes));
  change(container);
  const auto changed = SerializeContainer(container);
  EXPECT_TRUE(changed.ok()) << changed.status();
  return changed.ok() ? *changed : std::string();
}
Section& SectionOf(Container& container, std::string_view name) {
  return const_cast<Section&>(*container.Find(name));
}
template <typename T>
void Poke(Container& container, std::string_view name, size_t element, T value) {
  std::memcpy(SectionOf(container, name).bytes.data() + element * sizeof(T), &value, sizeof(T));
}

TEST(TileSetTest, RoundTripKeepsEverything) {
  for (const char* id : {"plane-16", "plane-81", "surface-26", "surface-96"}) {
    const TileSet before = SmallTileSet(id);
    const auto bytes = SerializeTileSet(before);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    const auto after = ParseTileSet(Bytes(*bytes));
    ASSERT_TRUE(after.ok()) << after.status();
    EXPECT_EQ(after->arrangement_id, before.arrangement_id);
    EXPECT_EQ(after->arrangement_sha256, before.arrangement_sha256);
    EXPECT_EQ(after->tile_size, before.tile_size);
    EXPECT_EQ(after->strip_height, before.strip_height);
    EXPECT_EQ(after->tile_codes, before.tile_codes);
    EXPECT_EQ(after->tile_index, before.tile_index);
    EXPECT_EQ(after->source_pixels, before.source_pixels);
    EXPECT_EQ(after->seam_heat, before.seam_heat);
    EXPECT_EQ(after->btfels.codes, before.btfels.codes);
    EXPECT_EQ(after->btfels.offset, before.btfels.offset);
    EXPECT_EQ(after->btfels.step, before.btfels.step);
    EXPECT_EQ(after->btfels.views.size(), before.btfels.views.size());
    EXPECT_EQ(after->btfels.tables.at("basis_light").values, before.btfels.tables.at("basis_light").values);
    EXPECT_EQ(after->provenance.citation, before.provenance.citation);
    EXPECT_EQ(after->radiometry, before.radiometry);
    EXPECT_EQ(after->certificate, before.certificate);
    EXPECT_EQ(after->metadata, before.metadata);
    EXPECT_EQ(after->other_keys, before.other_keys);
    EXPECT_EQ(*SerializeTileSet(*after), *bytes);
  }
}

TEST(TileSetTest, SectionsAreThoseOfTheFormat) {
  const Container container = *ParseContainer(Bytes(*SerializeTileSet(SmallTileSet("plane-16"))));
  EXPECT_EQ(container.kind, "tile_set");
  EXPECT_EQ(container.header["arrangement"]["id"], "plane-16");
  EXPECT_EQ(container.header["strip_height"], 4);
  const Section* index = container.Find("tile_index");
  ASSERT_NE(index, nullptr);
  EXPECT_EQ(index->dtype, DType::kU32);
  EXPECT_THAT(index->shape, testing::ElementsAre(16, 8, 8));
  EXPECT_THAT(container.Find("tile_codes")->shape, testing::ElementsAre(16));
  EXPECT_NE(container.Find("btfel_order"), nullptr);
  EXPECT_EQ(container.Find("btfels.0")->shape[0], 50);
}

TEST(TileSetTest, HostileValuesAreRefusedByName) {
  const std::string bytes = *SerializeTileSet(SmallTileSet("plane-16"));
  const auto message = [&](const std::function<void(Container&)>& change) {
    const auto parsed = ParseTileSet(Bytes(Changed(bytes, change)));
    EXPECT_FALSE(parsed.ok());
    return std::string(parsed.status().message());
  };
  EXPECT_THAT(message([](Container& c) { Poke<uint32_t>(c, "tile_index", 65, PackTexel(50, 3)); }),
              HasSubstr("section 'tile_index': tile 1, texel (1, 0) names BTFel 50; there are 50"));
  EXPECT_THAT(message([](Container& c) { Poke<uint32_t>(c, "source_pixels", 7, 19); }),
              HasSubstr("section 'source_pixels': 50 pixels for 50 BTFels, or not strictly ascending"));
  EXPECT_THAT(message([](Container& c) {
                SectionOf(c, "source_pixels").shape = {25};
                SectionOf(c, "source_pixels").bytes.resize(100);
              }),
              HasSubstr("section 'source_pixels': 25 pixels for 50 BTFels"));
  EXPECT_THAT(message([](Container& c) {
                SectionOf(c, "seam_heat").shape = {16, 4, 16};
              }),
              HasSubstr("seam_heat"));
  EXPECT_THAT(message([](Container& c) { Poke<uint32_t>(c, "tile_codes", 3, 1000); }),
              HasSubstr("tile_codes"));
  EXPECT_THAT(message([](Container& c) { Poke<uint32_t>(c, "tile_codes", 15, 255); }),
              HasSubstr("tile codes have"));
  EXPECT_THAT(message([](Container& c) { c.header["strip_height"] = -1; }), HasSubstr("strip_height"));
  EXPECT_THAT(message([](Container& c) { c.header["strip_height"] = ~uint64_t{0}; }),
              HasSubstr("strip_height"));
  EXPECT_THAT(message([](Container& c) { c.header["strip_height"] = 4.5; }), HasSubstr("strip_height"));
  EXPECT_THAT(message([](Container& c) { c.header["strip_height"] = 9; }),
              HasSubstr("strip height 9, expected 1 to the tile size, 8"));
  EXPECT_THAT(message([](Container& c) { c.header["metadata"] = 3; }), HasSubstr("'metadata' is no object"));
  EXPECT_THAT(message([](Container& c) { c.header["certificate"] = "good"; }),
              HasSubstr("'certificate' is no object"));
  EXPECT_THAT(message([](Container& c) { c.header.erase("arrangement"); }),
              HasSubstr("'arrangement' is missing"));
  EXPECT_THAT(message([](Container& c) { c.header["arrangement"]["id"] = "Plane 16\n"; }),
              HasSubstr("the id is not"));
  EXPECT_THAT(message([](Container& c) { c.header["arrangement"]["sha256"] = "abc"; }),
              HasSubstr("sha256 is not 64"));
  EXPECT_THAT(message([](Container& c) {
                SectionOf(c, "tile_index").shape = {16, 4, 16};
              }),
              HasSubstr("square"));
  EXPECT_THAT(message([](Container& c) {
                SectionOf(c, "tile_index").shape = {64, 4, 4};
              }),
              HasSubstr("tile_index"));
  EXPECT_THAT(message([](Container& c) { c.kind = "material"; }),
              HasSubstr("container kind 'material', expected 'tile_set'"));
  EXPECT_THAT(message([](Container& c) { c.header["codec"]["id"] = "magic"; }), HasSubstr("magic"));
  for (const char* name :
       {"tile_codes", "tile_index", "btfel_order", "btfels.0", "offset", "step", "views", "lights"}) {
    EXPECT_THAT(message([&](Container& c) { SectionOf(c, name).name = "elsewhere"; }), HasSubstr(name));
  }
}

TEST(TileSetTest, AnotherListUnderAKnownIdIsRefusedWithBothDigests) {
  TileSet tile_set = SmallTileSet("plane-16");
  tile_set.arrangement_sha256 = std::string(64, 'a');
  const auto bytes = SerializeTileSet(tile_set);
  EXPECT_EQ(bytes.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(bytes.status().message()), HasSubstr(std::string(64, 'a')));
  EXPECT_THAT(std::string(bytes.status().message()), HasSubstr((*FindArrangement("plane-16"))->sha256));
}

TEST(TileSetTest, ArrangementsOfLaterVersionsAreReadIfTheirDigestHolds) {
  TileSet tile_set = SmallTileSet("plane-16");
  tile_set.arrangement_id = "plane-99";
  EXPECT_THAT(std::string(SerializeTileSet(tile_set).status().message()), HasSubstr("tile codes have"));
  Arrangement later;
  later.id = "plane-99";
  later.codes = tile_set.tile_codes;
  const std::string listing = ArrangementListing(later);
  tile_set.arrangement_sha256 = Sha256Hex(Bytes(listing));
  const auto bytes = SerializeTileSet(tile_set);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  EXPECT_TRUE(ParseTileSet(Bytes(*bytes)).ok());
}

TEST(DressingTest, RoundTripKeepsEverything) {
  Dressing before = SmallDressing();
  before.other_keys = {{"future_key", "kept"}};
  const auto bytes = SerializeDressing(before);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  const auto after = ParseDressing(Bytes(*bytes));
  ASSERT_TRUE(after.ok()) << after.status();
  EXPECT_EQ(after->mesh.positions, before.mesh.positions);
  EXPECT_EQ(after->mesh.normals, before.mesh.normals);
  EXPECT_EQ(after->mesh.quads, before.mesh.quads);
  EXPECT_EQ(after->tile, before.tile);
  EXPECT_EQ(after->turns, before.turns);
  EXPECT_EQ(after->seed, ~uint64_t{0});
  EXPECT_EQ(after->source_mesh_sha256, QuadMeshSha256(Cube()));
  EXPECT_EQ(after->metadata, before.metadata);
  EXPECT_EQ(after->other_keys, before.other_keys);
  EXPECT_EQ(*SerializeDressing(*after), *bytes);
}

TEST(DressingTest, HostileValuesAreRefusedByName) {
  const std::string bytes = *SerializeDressing(SmallDressing());
  const auto message = [&](const std::function<void(Container&)>& change) {
    const auto parsed = ParseDressing(Bytes(Changed(bytes, change)));
    EXPECT_FALSE(parsed.ok());
    return std::string(parsed.status().message());
  };
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(message([](Container& c) { Poke<float>(c, "positions", 4, kNan); }),
              HasSubstr("vertex 2: the position is not finite"));
  EXPECT_THAT(message([](Container& c) { Poke<float>(c, "normals", 0, 3.0f); }),
              HasSubstr("vertex 1: the normal has length"));
  EXPECT_THAT(message([](Container& c) { Poke<uint32_t>(c, "quads", 5, 4000000); }),
              HasSubstr("face 2: vertex 4000001 does not exist"));
  EXPECT_THAT(message([](Container& c) { Poke<uint32_t>(c, "tile", 3, 96); }),
              HasSubstr("quad 4: tile 96 does not exist; surface-96 has 96"));
  EXPECT_THAT(message([](Container& c) { Poke<uint8_t>(c, "turns", 0, 4); }),
              HasSubstr("quad 1: 4 turns, expected 0..3"));
  EXPECT_THAT(message([](Container& c) { c.header["seed"] = -5; }), HasSubstr("'seed'"));
  EXPECT_THAT(message([](Container& c) { c.header.erase("seed"); }), HasSubstr("'seed'"));
  EXPECT_THAT(message([](Container& c) { c.header["source_mesh_sha256"] = 5; }),
              HasSubstr("source_mesh_sha256"));
  EXPECT_THAT(
      message([](Container& c) { c.header["arrangement"]["sha256"] = std::string(64, '0'); }),
      testing::AllOf(HasSubstr(std::string(64, '0')), HasSubstr((*FindArrangement("surface-96"))->sha256)));
  EXPECT_THAT(message([](Container& c) {
                SectionOf(c, "turns").shape = {1};
                SectionOf(c, "turns").bytes.resize(1);
              }),
              HasSubstr("turns"));
  EXPECT_THAT(message([](Container& c) {
                for (const char* name : {"quads", "tile", "turns"}) {
                  SectionOf(c, name).shape[0] = 0;
                  SectionOf(c, name).bytes.clear();
                }
              }),
              HasSubstr("no faces"));
  for (const char* name : {"positions", "normals", "quads", "tile", "turns"}) {
    EXPECT_THAT(message([&](Container& c) { SectionOf(c, name).name = "elsewhere"; }), HasSubstr(name));
  }
}

TEST(WangContainersTest, EveryTruncationIsRefused) {
  const std::string dressing = *SerializeDressing(SmallDressing());
  for (size_t length = 0; length < dressing.size(); ++length) {
    EXPECT_FALSE(ParseDressing(Bytes(dressing.substr(0, length))).ok()) << length;
  }
  const std::string tile_set = *SerializeTileSet(SmallTileSet("plane-16"));
  for (size_t length = 0; length < tile_set.size(); length += 7) {
    EXPECT_FALSE(ParseTileSet(Bytes(tile_set.substr(0, length))).ok()) << length;
  }
}

}  // namespace
}  // namespace tessera
