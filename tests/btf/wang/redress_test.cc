#include "btf/wang/redress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/wang/dress.h"
#include "btf/wang/shapes.h"
#include "tests/btf/wang/meshes.h"
#include "tests/btf/wang/small_tile_set.h"

namespace tessera {
namespace {

Dressing Dressed(std::string_view arrangement) {
  return DressMesh(*BuiltinShape("torus"), **FindArrangement(arrangement), {}, RunContext{})->dressing;
}

TEST(RedressTest, EveryQuadShowsItsTileOfAnySetOfTheArrangement) {
  for (const char* id : {"plane-16", "plane-81", "surface-26", "surface-96"}) {
    const Dressing dressing = Dressed(id);
    for (const uint64_t material : {1u, 2u}) {
      const TileSet tile_set = SmallTileSet(id, material);
      const auto binding = Redress(dressing, tile_set);
      ASSERT_TRUE(binding.ok()) << binding.status();
      ASSERT_EQ(binding->texels.size(), dressing.mesh.quads.size());
      for (size_t quad = 0; quad < binding->texels.size(); ++quad) {
        for (int y = 0; y < tile_set.tile_size; ++y) {
          for (int x = 0; x < tile_set.tile_size; ++x) {
            EXPECT_EQ(binding->texels[quad][y * binding->tile_size + x],
                      tile_set.texel(static_cast<int>(dressing.tile[quad]), x, y));
          }
        }
      }
    }
  }
}

TEST(RedressTest, AnotherArrangementIsRefusedWithBothDigests) {
  const Dressing dressing = Dressed("surface-96");
  const auto binding = Redress(dressing, SmallTileSet("plane-16"));
  EXPECT_EQ(binding.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(binding.status().message()),
              testing::AllOf(testing::HasSubstr("surface-96"), testing::HasSubstr("plane-16"),
                             testing::HasSubstr(dressing.arrangement_sha256),
                             testing::HasSubstr((*FindArrangement("plane-16"))->sha256)));
}

TEST(RedressTest, DamagedTablesAreRefused) {
  const TileSet tile_set = SmallTileSet("surface-96");
  Dressing dressing = Dressed("surface-96");
  dressing.tile[9] = 96;
  EXPECT_THAT(std::string(Redress(dressing, tile_set).status().message()),
              testing::HasSubstr("quad 10: tile 96"));
  dressing = Dressed("surface-96");
  dressing.turns.pop_back();
  EXPECT_EQ(Redress(dressing, tile_set).status().code(), absl::StatusCode::kInvalidArgument);
  TileSet short_set = tile_set;
  short_set.tile_index.pop_back();
  EXPECT_EQ(Redress(Dressed("surface-96"), short_set).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera
