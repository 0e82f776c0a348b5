// Searches on curves that are known: what is found, and how few settings are measured for it.
#include "btf/choice/ladder_search.h"

#include <cmath>
#include <functional>

#include <gtest/gtest.h>

#include "btf/data/direction_sets.h"

namespace tessera {
namespace {

Ladder TenRungs() {
  Ladder ladder{.codec = "test", .stops = {2, 5, 9}};
  for (uint64_t rung = 0; rung < 10; ++rung) {
    ladder.rungs.push_back({std::to_string(rung), {.rank = static_cast<int>(rung)}, 100 * (rung + 1)});
  }
  return ladder;
}

// Bytes are the codes and ten more.
LadderSearch SearchOf(const std::function<double(int)>& error, int& num_measured) {
  return {TenRungs(), [error, &num_measured](const Setting& setting) -> absl::StatusOr<SettingFigures> {
            ++num_measured;
            return SettingFigures{.bytes = setting.code_bytes + 10,
                                  .coefficients_read = setting.params.rank,
                                  .lights_rmse = error(setting.params.rank),
                                  .views_rmse = 0.0};
          }};
}

double Falling(int rung) {
  return std::pow(0.8, rung);
}

TEST(LadderSearchTest, FindsTheSmallestThatMeetsEveryBound) {
  for (int wanted = 0; wanted < 10; ++wanted) {
    int num_measured = 0;
    LadderSearch search = SearchOf(&Falling, num_measured);
    const auto found = search.SmallestWithin({.max_error = 1.0001 * Falling(wanted)});
    ASSERT_TRUE(found.ok());
    EXPECT_EQ(*found, static_cast<size_t>(wanted));
    EXPECT_LE(num_measured, 6) << wanted;
  }
}

TEST(LadderSearchTest, NothingMeetsWhatIsBelowTheTop) {
  int num_measured = 0;
  LadderSearch search = SearchOf(&Falling, num_measured);
  const auto found = search.SmallestWithin({.max_error = 0.99 * Falling(9)});
  ASSERT_TRUE(found.ok());
  EXPECT_FALSE(found->has_value());
  EXPECT_TRUE(search.measured().contains(9));
}

TEST(LadderSearchTest, StopsClimbingWhereTheErrorHasLevelledOff) {
  int num_measured = 0;
  const auto level = [](int rung) { return 0.5 - 0.001 * rung; };
  LadderSearch search = SearchOf(level, num_measured);
  ASSERT_FALSE(search.SmallestWithin({.max_error = 0.1})->has_value());
  EXPECT_FALSE(search.measured().contains(9));
}

TEST(LadderSearchTest, FindsTheDipOfACurveThatRisesAgain) {
  int num_measured = 0;
  const auto dip = [](int rung) { return 0.1 + 0.01 * std::abs(rung - 4); };
  LadderSearch search = SearchOf(dip, num_measured);
  EXPECT_EQ(*search.SmallestWithin({.max_error = 0.1001}), std::optional<size_t>(4));
  EXPECT_EQ(*search.MostAccurateWithin(10'000), std::optional<size_t>(4));
}

TEST(LadderSearchTest, BytesBoundTheSearchTablesIncluded) {
  int num_measured = 0;
  LadderSearch search = SearchOf(&Falling, num_measured);
  EXPECT_EQ(*search.MostAccurateWithin(710), std::optional<size_t>(6));
  EXPECT_EQ(*search.MostAccurateWithin(709), std::optional<size_t>(5));  // codes of 700 fit, 10 more do not
  EXPECT_EQ(*search.MostAccurateWithin(109), std::nullopt);
  EXPECT_EQ(*search.MostAccurateWithin(99), std::nullopt);
  EXPECT_EQ(*search.SmallestWithin({.max_error = Falling(3), .max_bytes = 300}), std::nullopt);
  for (const auto& [rung, figures] : search.measured()) {
    EXPECT_LE(rung, 6U);
  }
}

TEST(LadderSearchTest, BetterFiguresChangeWhatIsFound) {
  int num_measured = 0;
  LadderSearch search = SearchOf(&Falling, num_measured);
  const ModelBound bound{.max_error = 1.0001 * Falling(3)};
  ASSERT_EQ(*search.SmallestWithin(bound), std::optional<size_t>(3));
  SettingFigures worse = search.measured().at(3);
  worse.views_rmse = 2.0;
  search.Correct(3, worse);
  EXPECT_EQ(*search.SmallestWithin(bound), std::optional<size_t>(4));
}

TEST(LadderSearchTest, ACodecThatRefusesIsOutAndAStopEndsAll) {
  absl::Status status = absl::ResourceExhaustedError("too many lights");
  LadderSearch search(TenRungs(),
                      [&status](const Setting&) -> absl::StatusOr<SettingFigures> { return status; });
  EXPECT_EQ(*search.SmallestWithin({.max_error = 1.0}), std::nullopt);
  EXPECT_EQ(search.refusal(), status);
  status = absl::CancelledError("cancelled");
  LadderSearch stopped(TenRungs(),
                       [&status](const Setting&) -> absl::StatusOr<SettingFigures> { return status; });
  EXPECT_EQ(stopped.SmallestWithin({.max_error = 1.0}).status(), status);
}

TEST(ChoiceLaddersTest, RungsGrowAndStopsEndAtTheTop) {
  BtfInfo info{.width = 7, .height = 5, .views = *DirectionSet("ubo81"), .lights = *DirectionSet("3x4")};
  for (const Ladder& ladder : ChoiceLadders(info, {.spill_folder = "here"})) {
    ASSERT_FALSE(ladder.rungs.empty()) << ladder.codec;
    EXPECT_NE(FindCodec(ladder.codec), nullptr);
    EXPECT_EQ(ladder.stops.back(), ladder.rungs.size() - 1) << ladder.codec;
    for (size_t i = 0; i < ladder.rungs.size(); ++i) {
      EXPECT_EQ(ladder.rungs[i].params.spill_folder, "here");
      if (i > 0) {
        EXPECT_LT(ladder.rungs[i - 1].code_bytes, ladder.rungs[i].code_bytes) << ladder.rungs[i].label;
      }
    }
    if (ladder.codec == "view-pca") {
      EXPECT_LT(ladder.rungs.back().params.eigen_textures, static_cast<int>(info.lights.size()));
    }
  }
}

}  // namespace
}  // namespace tessera
