#include "viewer/viewer_state.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/viewer/fake_source.h"

namespace tessera::viewer {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

class ViewerStateTest : public ::testing::Test {
 protected:
  ViewerStateTest() {
    for (const char* name : {"surface-96/a", "surface-96/b"}) {
      server_.sets[name] = FlatTileSet("surface-96");
    }
    server_.sets["plane-16/p"] = FlatTileSet("plane-16");
  }

  void Begin(const std::string& tile_set = "") {
    loader_ = std::make_unique<Loader>(std::make_unique<FakeSource>(server_), [] {});
    state_ = std::make_unique<ViewerState>(
        *loader_,
        ViewerOptions{"127.0.0.1:1", {.mesh = "builtin:plane", .arrangement = "surface-96"}, tile_set});
    state_->Begin();
    Settle();
  }

  void Settle() {
    while (!loader_->IsIdle()) {
      for (LoadEvent& event : loader_->Take()) {
        state_->Apply(std::move(event));
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }

  FakeServer server_;
  std::unique_ptr<Loader> loader_;
  std::unique_ptr<ViewerState> state_;
};

TEST_F(ViewerStateTest, BeginsWithTheFirstTileSetOfTheArrangement) {
  Begin();
  EXPECT_THAT(state_->entries(), SizeIs(2));
  EXPECT_EQ(state_->shown_name(), "surface-96/a");
  EXPECT_EQ(state_->shown(), server_.sets["surface-96/a"]);
  EXPECT_THAT(state_->messages(), IsEmpty());
}

TEST_F(ViewerStateTest, AResidentTileSetIsShownAtOnceWithoutAskingAgain) {
  Begin();
  state_->Select("surface-96/b");
  EXPECT_EQ(state_->shown_name(), "surface-96/a") << "what is shown stays until the other one comes";
  EXPECT_TRUE(state_->is_loading());
  Settle();
  EXPECT_EQ(state_->shown_name(), "surface-96/b");
  state_->Select("surface-96/a");
  EXPECT_EQ(state_->shown_name(), "surface-96/a");
  EXPECT_FALSE(state_->is_loading());
  EXPECT_THAT(server_.fetched(), ElementsAre("surface-96/a", "surface-96/b"));
}

TEST_F(ViewerStateTest, AResidentOneReplacesOneThatIsOnItsWay) {
  Begin();
  server_.Hold("surface-96/b");
  state_->Select("surface-96/b");
  server_.WaitUntilFetching("surface-96/b");
  state_->Select("surface-96/a");
  server_.Release("surface-96/b");
  Settle();
  EXPECT_EQ(state_->shown_name(), "surface-96/a");
  EXPECT_FALSE(state_->is_loading());
}

TEST_F(ViewerStateTest, SaysThatThereIsNoServer) {
  server_.list_status = absl::UnavailableError("no server at 127.0.0.1:1");
  Begin();
  ASSERT_THAT(state_->messages(), SizeIs(1));
  EXPECT_TRUE(state_->messages()[0].is_error);
  EXPECT_THAT(state_->messages()[0].text, HasSubstr("no server at 127.0.0.1:1"));
  server_.list_status = absl::OkStatus();
  state_->Refresh();
  Settle();
  EXPECT_THAT(state_->messages(), IsEmpty());
  EXPECT_EQ(state_->shown_name(), "surface-96/a");
}

TEST_F(ViewerStateTest, SaysWhichTileSetIsNotThereAndKeepsWhatIsShown) {
  Begin();
  state_->Select("surface-96/none");
  Settle();
  ASSERT_THAT(state_->messages(), SizeIs(1));
  EXPECT_THAT(state_->messages()[0].text, HasSubstr("surface-96/none"));
  EXPECT_EQ(state_->shown_name(), "surface-96/a");
  state_->Select("surface-96/b");
  Settle();
  EXPECT_THAT(state_->messages(), IsEmpty()) << "the next one is fine";
}

TEST_F(ViewerStateTest, RefusesATileSetOfAnotherArrangement) {
  Begin("plane-16/p");
  EXPECT_EQ(state_->shown(), nullptr);
  ASSERT_THAT(state_->messages(), SizeIs(1));
  EXPECT_THAT(state_->messages()[0].text, HasSubstr("plane-16"));
  EXPECT_THAT(state_->messages()[0].text, HasSubstr("surface-96"));
}

TEST_F(ViewerStateTest, SaysWhatIsWrongWithTheMesh) {
  server_.surface_status = absl::NotFoundError("horse.obj: no such file");
  Begin();
  ASSERT_THAT(state_->messages(), SizeIs(1));
  EXPECT_THAT(state_->messages()[0].text, HasSubstr("horse.obj: no such file"));
}

TEST_F(ViewerStateTest, ThumbnailsAreAskedForOnceAndOnlyWhereThereAre) {
  server_.without_thumbnail = {"surface-96/a"};
  Begin();
  const size_t fetched_before = server_.fetched().size();
  const TileSetEntry entry = *state_->EntryOf("surface-96/b");
  state_->WantThumbnail(entry);
  state_->WantThumbnail(entry);
  state_->WantThumbnail(*state_->EntryOf("surface-96/a"));
  Settle();
  const auto thumbnails = state_->TakeThumbnails();
  ASSERT_THAT(thumbnails, SizeIs(1));
  EXPECT_EQ(thumbnails[0].first, "picture of surface-96/b");
  EXPECT_EQ(thumbnails[0].second.width, 1);
  EXPECT_EQ(server_.fetched().size(), fetched_before + 1);
  EXPECT_FALSE(state_->IsResident(entry));
  state_->WantThumbnail(entry);
  Settle();
  EXPECT_THAT(state_->TakeThumbnails(), SizeIs(0));
  state_->Refresh();
  state_->WantThumbnail(entry);
  Settle();
  EXPECT_THAT(state_->TakeThumbnails(), SizeIs(1));
}

TEST(RecentTest, TheOneNotUsedForLongestGoesFirst) {
  Recent<std::string, int> recent(3, 10);
  recent.Put("a", 1, 4);
  recent.Put("b", 2, 4);
  ASSERT_NE(recent.Use("a"), nullptr);
  recent.Put("c", 3, 4);
  EXPECT_TRUE(recent.Contains("a"));
  EXPECT_FALSE(recent.Contains("b"));
  recent.Put("large", 4, 100);
  EXPECT_EQ(recent.size(), 1u) << "one is kept whatever it costs";
  EXPECT_EQ(recent.cost(), 100u);
}

}  // namespace
}  // namespace tessera::viewer
