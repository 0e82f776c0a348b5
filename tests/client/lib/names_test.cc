#include "client/lib/names.h"

#include <gtest/gtest.h>

#include "proto/wire/status.h"

namespace tessera {
namespace {

TEST(NamesTest, ShortAndFullFormsMeanTheSame) {
  EXPECT_EQ(FullMaterialName("wool").value(), "materials/wool");
  EXPECT_EQ(FullMaterialName("materials/wool").value(), "materials/wool");
  EXPECT_EQ(FullArrangementName("surface-96").value(), "arrangements/surface-96");
  EXPECT_EQ(FullTileSetName("surface-96/wool").value(), "arrangements/surface-96/tileSets/wool");
  EXPECT_EQ(FullTileSetName("arrangements/surface-96/tileSets/wool").value(),
            "arrangements/surface-96/tileSets/wool");
  EXPECT_EQ(FullJobName("17").value(), "jobs/17");
  for (const char* full : {"materials/wool", "jobs/17", "arrangements/surface-96"}) {
    EXPECT_EQ(ShortName(full), std::string(full).substr(std::string(full).find('/') + 1));
  }
  EXPECT_EQ(ShortName("arrangements/surface-96/tileSets/wool"), "surface-96/wool");
  EXPECT_EQ(ShortName("surface-96/wool"), "surface-96/wool");
}

TEST(NamesTest, RefusesWhatTheServiceWouldRefuse) {
  for (const std::string& bad : {std::string(), std::string("Wool"), std::string("a b"), std::string("a/b"),
                                 std::string("../x"), std::string(64, 'a')}) {
    const auto name = FullMaterialName(bad);
    EXPECT_EQ(name.status().code(), absl::StatusCode::kInvalidArgument) << bad;
    EXPECT_EQ(ReasonOf(name.status()), "NAME_INVALID") << bad;
  }
  for (const char* bad : {"wool", "surface-96/", "/wool", "a/b/c", "arrangements/a/tilesets/b"}) {
    EXPECT_FALSE(FullTileSetName(bad).ok()) << bad;
  }
  EXPECT_TRUE(FullMaterialName(std::string(63, 'a')).ok());
}

}  // namespace
}  // namespace tessera
