#include "btf/tiles/recipe.h"

#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

constexpr char kWhole[] = R"({
  "features": [
    {"name": "pit", "seeds": {"feature": [[[4, 5], [6, 7]], [[9, 9]]], "background": [[[1, 1]]]}, "only_placed": true},
    {"name": "lip", "rectangle": [10, 20, 16, 12]}],
  "placements": [
    {"feature": "pit", "strip": {"orientation": "vertical", "colour": 1}, "position": [3, 30]},
    {"feature": "lip", "tile": 165, "position": [20, 21], "turn": 0}],
  "corners": [{"strip": {"orientation": "horizontal", "colour": 0}, "end": "end", "position": [7, 8]}],
  "colours": [{"of": "pit", "hue_deg": -120, "saturation": 1.5}, {"of": "background", "saturation": 0}]
})";

TEST(RecipeTest, ReadsEveryKey) {
  const auto recipe = ParseRecipe(kWhole);
  ASSERT_TRUE(recipe.ok()) << recipe.status();
  ASSERT_EQ(recipe->features.size(), 2u);
  EXPECT_EQ(recipe->features[0].name, "pit");
  EXPECT_TRUE(recipe->features[0].only_placed);
  EXPECT_EQ(recipe->features[0].guide.feature, (std::vector<Stroke>{{{4, 5}, {6, 7}}, {{9, 9}}}));
  EXPECT_EQ(recipe->features[0].guide.background, (std::vector<Stroke>{{{1, 1}}}));
  EXPECT_FALSE(recipe->features[0].guide.rectangle);
  EXPECT_EQ(recipe->features[1].guide.rectangle->width, 16);
  EXPECT_EQ(recipe->features[1].guide.rectangle->y, 20);
  EXPECT_EQ(recipe->placements[0].strip->orientation, StripOrientation::kVertical);
  EXPECT_EQ(recipe->placements[0].strip->colour, 1);
  EXPECT_EQ(recipe->placements[1].feature, 1);
  EXPECT_EQ(recipe->placements[1].tile, 165u);
  EXPECT_EQ(recipe->placements[1].position, (std::array{20, 21}));
  EXPECT_FALSE(recipe->corners[0].is_start);
  EXPECT_EQ(recipe->colours[0].hue_deg, -120.0);
  EXPECT_EQ(recipe->colours[1].feature, -1);
  EXPECT_TRUE(CheckRecipe(*recipe, **FindArrangement("plane-16"), 64, 16).ok());
  EXPECT_TRUE(ParseRecipe("{}").ok());
}

TEST(RecipeTest, OneSpellingWhateverTheWhiteSpace) {
  EXPECT_EQ(ParseRecipe(R"({"colours": [{"of": "background", "hue_deg": 5}], "features": []})")->json.dump(),
            ParseRecipe(R"( {"features":[],"colours":[{"hue_deg":5,"of":"background"}]})")->json.dump());
}

TEST(RecipeTest, RefusesByThePathOfTheKey) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"[", "recipe: not JSON"},
      {"[]", "recipe: not an object"},
      {R"({"feature": []})", "feature: unknown key, known: features, placements, corners, colours"},
      {R"({"features": {}})", "features: expected an array"},
      {R"({"features": [{"rectangle": [1, 1, 4, 4]}]})", "features[0].name: missing"},
      {R"({"features": [{"name": "A b", "rectangle": [1, 1, 4, 4]}]})", "features[0].name: expected a name"},
      {R"({"features": [{"name": "background", "rectangle": [1, 1, 4, 4]}]})",
       "features[0].name: \"background\" is taken"},
      {R"({"features": [{"name": "a"}]})", "features[0]: needs a rectangle or seeds.feature"},
      {R"({"features": [{"name": "a", "seed": 1}]})", "features[0].seed: unknown key"},
      {R"({"features": [{"name": "a", "seeds": {"feature": [[[1, -2]]]}}]})",
       "features[0].seeds.feature[0][0][1]: -2, expected a whole number in [0, "},
      {R"({"features": [{"name": "a", "seeds": {"feature": [[]]}}]})",
       "features[0].seeds.feature[0]: expected"},
      {R"({"features": [{"name": "a", "rectangle": [1, 1, 0, 4]}]})",
       "features[0].rectangle[2]: 0, expected"},
      {R"({"features": [{"name": "a", "rectangle": [1, 1, 1e99, 4]}]})", "features[0].rectangle[2]: 1e+99"},
      {R"({"placements": [{"feature": "a", "tile": 1, "position": [1, 1]}]})",
       "placements[0].feature: no feature is named \"a\""},
      {R"({"placements": [{"feature": "background", "tile": 1, "position": [1, 1]}]})",
       "placements[0].feature: the background cannot be placed"},
      {R"({"features": [{"name": "a", "rectangle": [1, 1, 4, 4]}], "placements": [{"feature": "a", "position": [1, 1]}]})",
       "placements[0]: needs one of strip and tile"},
      {R"({"corners": [{"strip": {"colour": 127}, "end": "start", "position": [1, 1]}]})",
       "corners[0].strip.colour: 127, expected a whole number in [0, 126]"},
      {R"({"corners": [{"strip": {"colour": 1}, "end": "top", "position": [1, 1]}]})",
       "corners[0].end: expected \"start\" or \"end\""},
      {R"({"colours": [{"of": "background", "hue_deg": 361}]})",
       "colours[0].hue_deg: 361, expected a number in"},
      {R"({"colours": [{"of": "background", "saturation": "much"}]})", "colours[0].saturation: not a number"},
      {R"({"colours": [{"of": "background"}, {"of": "background"}]})",
       "colours[1].of: its colour is moved before"},
  };
  for (const auto& [text, message] : cases) {
    const auto recipe = ParseRecipe(text);
    EXPECT_EQ(recipe.status().code(), absl::StatusCode::kInvalidArgument) << text;
    EXPECT_THAT(std::string(recipe.status().message()), StartsWith(message)) << text;
  }
}

TEST(RecipeTest, HostileTextIsRefused) {
  EXPECT_THAT(std::string(ParseRecipe(std::string(kMaxRecipeBytes + 1, ' ')).status().message()),
              HasSubstr("1048577 bytes, at most 1048576"));
  EXPECT_FALSE(ParseRecipe(std::string(100000, '[')).ok());
  const std::string half(100000, '[');
  EXPECT_THAT(
      std::string(
          ParseRecipe(R"({"features": )" + half + std::string(half.size(), ']') + "}").status().message()),
      StartsWith("features[0]: not an object"));
  std::string many = R"({"features": [{"name": "a", "seeds": {"feature": [[)";
  for (size_t i = 0; i <= kMaxStrokePoints; ++i) {
    many += i == 0 ? "[1, 1]" : ",[1, 1]";
  }
  EXPECT_THAT(std::string(ParseRecipe(many + "]]}}]}").status().message()), HasSubstr("at most 4096 in all"));
}

TEST(RecipeTest, WhatTheArrangementLacksIsRefused) {
  const std::string feature = R"({"features": [{"name": "a", "rectangle": [1, 1, 4, 4]}], "placements": [)";
  const auto message = [&](const std::string& placement, const char* arrangement) {
    const auto recipe = ParseRecipe(feature + placement + "]}");
    EXPECT_TRUE(recipe.ok()) << recipe.status();
    return std::string(CheckRecipe(*recipe, **FindArrangement(arrangement), 64, 16).message());
  };
  EXPECT_THAT(message(R"({"feature": "a", "strip": {"colour": 0}, "position": [9, 0]})", "plane-16"),
              StartsWith("placements[0].strip.orientation: missing"));
  EXPECT_THAT(
      message(R"({"feature": "a", "strip": {"colour": 0, "orientation": "vertical"}, "position": [9, 0]})",
              "surface-96"),
      StartsWith("placements[0].strip.orientation: the strips of surface-96 have none"));
  EXPECT_EQ(
      message(R"({"feature": "a", "strip": {"colour": 0}, "position": [9, 0], "turn": 3})", "surface-96"),
      "");
  const char* const third =
      R"({"feature": "a", "strip": {"colour": 2, "orientation": "vertical"}, "position": [9, 0]})";
  EXPECT_EQ(message(third, "plane-81"), "");
  EXPECT_THAT(message(third, "plane-16"),
              StartsWith("placements[0].strip.colour: 2, but plane-16 has the colours 0 to 1"));
  EXPECT_THAT(message(R"({"feature": "a", "tile": 165, "position": [9, 0], "turn": 3})", "plane-16"),
              StartsWith("placements[0].turn: 3: nothing is turned in plane-16"));
  EXPECT_THAT(message(R"({"feature": "a", "tile": 1, "position": [9, 0]})", "plane-16"),
              StartsWith("placements[0].tile: 1 is not the code of a tile of plane-16"));
  EXPECT_THAT(message(R"({"feature": "a", "tile": 160, "position": [9, 64]})", "plane-16"),
              StartsWith("placements[0].position: [9, 64] is off the tile, 64x64"));
  EXPECT_THAT(
      message(R"({"feature": "a", "strip": {"colour": 0, "orientation": "vertical"}, "position": [16, 9]})",
              "plane-16"),
      StartsWith("placements[0].position: [16, 9] is off the strip, 16x64"));
  const auto twice = ParseRecipe(R"({"corners": [{"strip": {"colour": 1}, "end": "end", "position": [1, 1]},
                                                 {"strip": {"colour": 1}, "end": "end", "position": [9, 1]}]})");
  EXPECT_THAT(std::string(CheckRecipe(*twice, **FindArrangement("surface-96"), 64, 16).message()),
              StartsWith("corners[1]: this end of this strip is given before"));
}

}  // namespace
}  // namespace tessera
