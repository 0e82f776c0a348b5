// The rule, on made-up figures.
#include "btf/choice/choice.h"

#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/reason.h"

namespace tessera {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

struct Point {
  uint64_t bytes = 0;
  double error = 0.0;
  int coefficients = 0;
};

Ladder LadderOf(const std::string& codec, const std::vector<Point>& points, bool projects = true) {
  Ladder ladder{.codec = codec, .projects_on_harmonics = projects, .stops = {points.size() - 1}};
  for (size_t i = 0; i < points.size(); ++i) {
    ladder.rungs.push_back({"of " + std::to_string(i), {.rank = static_cast<int>(i)}, points[i].bytes});
  }
  return ladder;
}

class ModelChooserTest : public ::testing::Test {
 protected:
  ModelChooser ChooserFor(const ModelGoal& goal) {
    std::vector<Ladder> ladders;
    for (const auto& [codec, points] : points_) {
      ladders.push_back(LadderOf(codec, points, codec != "views"));
    }
    return {goal, ladders,
            [this](const std::string& codec, const Setting& setting) -> absl::StatusOr<SettingFigures> {
              const Point& point = points_.at(codec)[setting.params.rank];
              return SettingFigures{.bytes = point.bytes,
                                    .coefficients_read = point.coefficients,
                                    .lights_rmse = 0.5 * point.error,
                                    .views_rmse = point.error};
            }};
  }
  std::string NameOf(ModelChooser& chooser) {
    const auto choice = chooser.Choose();
    return choice.ok() ? chooser.CodecOf(*choice) + " " + chooser.SettingOf(*choice).label
                       : std::string(choice.status().message());
  }

  std::map<std::string, std::vector<Point>> points_ = {
      {"low", {{1'000, 0.20, 4}, {2'000, 0.10, 8}, {4'000, 0.06, 16}}},
      {"sh", {{1'500, 0.18, 3}, {4'100, 0.058, 2}, {40'000, 0.03, 600}}},
      {"views", {{900, 0.15, 18}, {3'000, 0.055, 54}}},
  };
};

TEST_F(ModelChooserTest, TheSmallestThatMeetsTheErrorIsTaken) {
  ModelChooser chooser = ChooserFor({.max_error = 0.1});
  EXPECT_EQ(NameOf(chooser), "low of 1");
  ModelChooser looser = ChooserFor({.max_error = 0.16});
  EXPECT_EQ(NameOf(looser), "views of 0");
  ModelChooser tighter = ChooserFor({.max_error = 0.03});
  EXPECT_EQ(NameOf(tighter), "sh of 2");
}

TEST_F(ModelChooserTest, OfEqualSizesTheCheapestToDecodeIsTaken) {
  points_.erase("views");
  // 4,000 and 4,100 bytes are equal; 2 coefficients are fewer than 16.
  ModelChooser chooser = ChooserFor({.max_error = 0.06});
  EXPECT_EQ(NameOf(chooser), "sh of 1");
  points_["low"][2].coefficients = 2;  // equal in that, too: 0.058 is less than 0.06
  ModelChooser equal = ChooserFor({.max_error = 0.06});
  EXPECT_EQ(NameOf(equal), "sh of 1");
  points_["low"][2].error = 0.057;
  ModelChooser better = ChooserFor({.max_error = 0.06});
  EXPECT_EQ(NameOf(better), "low of 2");
  points_["sh"][1].bytes = 4'300;  // 7.5% more are not
  ModelChooser larger = ChooserFor({.max_error = 0.06});
  EXPECT_EQ(NameOf(larger), "low of 2");
}

TEST_F(ModelChooserTest, AnEnvironmentPrefersWhatProjectsOnHarmonics) {
  ModelChooser chooser = ChooserFor({.max_error = 0.16, .light = SceneLight::kEnvironment});
  EXPECT_EQ(NameOf(chooser), "low of 1");
  const auto choice = chooser.Choose();
  EXPECT_THAT(chooser.Record(*choice)["report"].dump(), HasSubstr("does not project on spherical harmonics"));
  points_.erase("low");
  points_.erase("sh");
  ModelChooser only = ChooserFor({.max_error = 0.16, .light = SceneLight::kEnvironment});
  EXPECT_EQ(NameOf(only), "views of 0");
}

TEST_F(ModelChooserTest, TheMostAccurateThatFitsAndNoLarger) {
  ModelChooser chooser = ChooserFor({.max_bytes = 4'050});
  EXPECT_EQ(NameOf(chooser), "views of 1");
  points_["low"][2].error = 0.0554;  // less than 1% off, but larger
  ModelChooser equal = ChooserFor({.max_bytes = 4'050});
  EXPECT_EQ(NameOf(equal), "views of 1");
  points_["views"][1].error = 0.0554;
  points_["low"][2].error = 0.055;
  ModelChooser smaller = ChooserFor({.max_bytes = 4'050});
  EXPECT_EQ(NameOf(smaller), "views of 1");
}

TEST_F(ModelChooserTest, RefusesWithTheBestFigureAndItsSetting) {
  ModelChooser chooser = ChooserFor({.max_error = 0.02});
  const absl::Status error = chooser.Choose().status();
  EXPECT_EQ(error.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ReasonOf(error), "BOUND_NOT_REACHED");
  EXPECT_THAT(std::string(error.message()),
              AllOf(HasSubstr("max_error = 0.02"), HasSubstr("0.03 by sh of 2"), HasSubstr("1.5 times")));
  ModelChooser small = ChooserFor({.max_bytes = 899});
  const absl::Status bytes = small.Choose().status();
  EXPECT_EQ(ReasonOf(bytes), "BOUND_NOT_REACHED");
  EXPECT_THAT(std::string(bytes.message()), AllOf(HasSubstr("views of 0"), HasSubstr("900 bytes")));
}

TEST_F(ModelChooserTest, RecordsWhatWasRejectedAndByHowMuch) {
  ModelChooser chooser = ChooserFor({.max_error = 0.1});
  const auto choice = chooser.Choose();
  ASSERT_TRUE(choice.ok());
  const nlohmann::json record = chooser.Record(*choice);
  EXPECT_EQ(record["chosen"]["codec"], "low");
  EXPECT_EQ(record["chosen"]["bytes"], 2'000);
  EXPECT_EQ(record["goal"]["max_error"], 0.1);
  ASSERT_EQ(record["rejected"].size(), 3U);
  EXPECT_EQ(record["rejected"][0]["setting"], "of 0");
  const std::string report = record["report"].dump();
  EXPECT_THAT(report, HasSubstr("rejected low of 0: error 0.2, 2 times the bound 0.1"));
  EXPECT_THAT(report,
              HasSubstr("rejected sh of 1: error 0.058, 4.0 KiB, 2.05 times the bytes, 2 coefficients"));
  EXPECT_THAT(report, HasSubstr("rejected views of 1: error 0.055, 2.9 KiB, 1.5 times the bytes"));
}

TEST_F(ModelChooserTest, CorrectedFiguresAreChosenBy) {
  ModelChooser chooser = ChooserFor({.max_error = 0.1});
  const auto first = chooser.Choose();
  ASSERT_TRUE(first.ok());
  SettingFigures figures = chooser.FiguresOf(*first);
  figures.sampled_rmse = 0.11;
  chooser.Correct(*first, figures);
  EXPECT_EQ(NameOf(chooser), "views of 1");
}

}  // namespace
}  // namespace tessera
