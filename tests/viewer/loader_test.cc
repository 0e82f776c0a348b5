#include "viewer/loader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/status.h"
#include "tests/viewer/fake_source.h"

namespace tessera::viewer {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class LoaderTest : public ::testing::Test {
 protected:
  LoaderTest() {
    for (const char* name : {"surface-96/a", "surface-96/b", "surface-96/c"}) {
      server_.sets[name] = FlatTileSet("surface-96");
    }
  }

  std::unique_ptr<Loader> MakeLoader() {
    return std::make_unique<Loader>(std::make_unique<FakeSource>(server_), [] {});
  }

  FakeServer server_;
};

TEST_F(LoaderTest, BringsWhatIsAskedFor) {
  const auto loader = MakeLoader();
  loader->List("surface-96");
  loader->Show("surface-96/a");
  const std::vector<LoadEvent> events = TakeAll(*loader);
  ASSERT_EQ(events.size(), 2u);
  const bool is_list_first = events[0].kind == LoadEvent::Kind::kList;
  const LoadEvent& list = events[is_list_first ? 0 : 1];
  EXPECT_TRUE(list.status.ok()) << list.status;
  EXPECT_EQ(list.entries.size(), 3u);
  EXPECT_EQ(events[is_list_first ? 1 : 0].tile_set, server_.sets["surface-96/a"]);
}

TEST_F(LoaderTest, TheLatestWinsOverTheOneThatRunsAndTheOneThatWaits) {
  server_.Hold("surface-96/a");
  const auto loader = MakeLoader();
  loader->Show("surface-96/a");
  server_.WaitUntilFetching("surface-96/a");
  loader->Show("surface-96/b");
  loader->Show("surface-96/c");
  const std::vector<LoadEvent> events = TakeAll(*loader);
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.back().name, "surface-96/c");
  for (const LoadEvent& event : events) {
    EXPECT_NE(event.name, "surface-96/a") << "it was replaced while it ran";
  }
}

TEST_F(LoaderTest, ACancelledShowSaysNothing) {
  server_.Hold("surface-96/a");
  const auto loader = MakeLoader();
  loader->Show("surface-96/a");
  server_.WaitUntilFetching("surface-96/a");
  loader->CancelShow();
  EXPECT_THAT(TakeAll(*loader), IsEmpty());
}

TEST_F(LoaderTest, ErrorsComeAsEvents) {
  const auto loader = MakeLoader();
  loader->Show("surface-96/none");
  const std::vector<LoadEvent> events = TakeAll(*loader);
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(Message(events[0].status), HasSubstr("surface-96/none"));
}

TEST_F(LoaderTest, ThumbnailsGiveWayAndComeAllTheSame) {
  server_.Hold("surface-96/a");
  const auto loader = MakeLoader();
  loader->LoadThumbnail({.name = "surface-96/a", .thumbnail_sha256 = "surface-96/a"});
  server_.WaitUntilFetching("surface-96/a");
  loader->LoadThumbnail({.name = "surface-96/a", .thumbnail_sha256 = "surface-96/a"});  // it runs already
  loader->LoadThumbnail({.name = "surface-96/b", .thumbnail_sha256 = "surface-96/b"});
  loader->Show("surface-96/c");
  server_.Release("surface-96/a");
  std::vector<std::string> names;
  for (const LoadEvent& event : TakeAll(*loader)) {
    names.push_back(event.name);
  }
  EXPECT_THAT(names, ElementsAre("surface-96/c", "surface-96/a", "surface-96/b"));
}

TEST_F(LoaderTest, EndsWhileItWorks) {
  server_.Hold("surface-96/a");
  auto loader = MakeLoader();
  loader->Show("surface-96/a");
  server_.WaitUntilFetching("surface-96/a");
  loader->LoadThumbnail({.name = "surface-96/b", .thumbnail_sha256 = "surface-96/b"});
  loader.reset();
  EXPECT_THAT(server_.fetched(), ElementsAre("surface-96/a"));
}

}  // namespace
}  // namespace tessera::viewer
