#include "viewer/mip_maker.h"

#include <atomic>
#include <chrono>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/viewer/fake_source.h"

namespace tessera::viewer {
namespace {

TEST(MipMakerTest, SaysWhyThereAreNone) {
  const std::shared_ptr<const TileSet> tile_set = FlatTileSet("surface-96");  // its codec has no name
  std::atomic<int> num_made = 0;
  MipMaker maker([&] { ++num_made; });
  EXPECT_FALSE(maker.IsBusy());
  const MipMaker::Answer first = maker.Get(tile_set);
  EXPECT_EQ(first.mips, nullptr);
  EXPECT_EQ(first.why_none, "");
  while (maker.IsBusy()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  EXPECT_EQ(num_made, 1);
  EXPECT_THAT(maker.Get(tile_set).why_none, testing::HasSubstr("codec"));
  EXPECT_FALSE(maker.IsBusy());  // what is known is not made again
}

}  // namespace
}  // namespace tessera::viewer
