#include "client/cli/contact_sheet.h"

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "client/cli/caption.h"

namespace tessera::cli {
namespace {

Image Plain(int width, int height, int channels, float value) {
  Image image(width, height, channels);
  std::fill(image.pixels.begin(), image.pixels.end(), value);
  return image;
}

TEST(ContactSheetTest, PlacesPicturesInReadingOrderOnWhite) {
  const auto sheet = ContactSheet({Plain(10, 6, 3, 0.1F), Plain(10, 6, 1, 0.2F), Plain(4, 2, 3, 0.3F)}, 2);
  ASSERT_TRUE(sheet.ok()) << sheet.status();
  EXPECT_EQ(sheet->width, 8 + 2 * 18);
  EXPECT_EQ(sheet->height, 8 + 2 * 14);
  EXPECT_FLOAT_EQ(sheet->at(0, 0)[0], 1.0F);
  EXPECT_FLOAT_EQ(sheet->at(8, 8)[0], 0.1F);
  EXPECT_FLOAT_EQ(sheet->at(26, 8)[2], 0.2F);
  EXPECT_FLOAT_EQ(sheet->at(8, 22)[0], 1.0F);  // centred in its cell
  EXPECT_FLOAT_EQ(sheet->at(8 + 3, 22 + 2)[0], 0.3F);
  EXPECT_FLOAT_EQ(sheet->at(30, 30)[0], 1.0F);
}

TEST(ContactSheetTest, LaysAlphaOverTheGround) {
  Image half = Plain(2, 2, 4, 0.5F);
  const auto sheet = ContactSheet({half}, 0);
  ASSERT_TRUE(sheet.ok());
  EXPECT_FLOAT_EQ(sheet->at(8, 8)[0], 0.75F);
}

TEST(ContactSheetTest, RefusesNothingAndTooMuch) {
  EXPECT_TRUE(absl::IsInvalidArgument(ContactSheet({}, 0).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(ContactSheet({Plain(1, 1, 1, 0)}, -1).status()));
  EXPECT_TRUE(
      absl::IsInvalidArgument(ContactSheet(std::vector<Image>(20, Plain(1000, 1, 1, 0)), 20).status()));
}

// Below each cell there is black writing, and none elsewhere.
TEST(ContactSheetTest, WritesCaptionsBelowTheirCells) {
  const std::vector<Image> pictures(3, Plain(200, 50, 3, 0.5F));
  const auto sheet = ContactSheet(pictures, 2, {"torus  surface-96/wool", "", std::string(40, 'w')});
  ASSERT_TRUE(sheet.ok()) << sheet.status();
  // 16 letters of 12 pixels a line: two lines, three for the last.
  constexpr int kBelow = 4 + 3 * 20;
  EXPECT_EQ(sheet->width, 8 + 2 * 208);
  EXPECT_EQ(sheet->height, 8 + 2 * (58 + kBelow));
  const auto has_ink = [&](int left, int top, int height) {
    int ink = 0;
    for (int y = top; y < top + height; ++y) {
      for (int x = left; x < left + 200; ++x) {
        ink += sheet->at(x, y)[0] == 0.0F ? 1 : 0;
      }
    }
    return ink > 0;
  };
  EXPECT_FALSE(has_ink(8, 8, 50));
  EXPECT_TRUE(has_ink(8, 58, 24));
  EXPECT_TRUE(has_ink(8, 82, 20));
  EXPECT_FALSE(has_ink(8, 102, 20));
  EXPECT_FALSE(has_ink(216, 58, kBelow));
  const int second_row = 8 + 58 + kBelow;
  EXPECT_TRUE(has_ink(8, second_row + 50 + 4 + 40, 20));
  EXPECT_TRUE(absl::IsInvalidArgument(ContactSheet(pictures, 2, {"one", "two"}).status()));
}

TEST(CaptionTest, BreaksLinesWhereWordsEnd) {
  EXPECT_EQ(BrokenLines("surface-96/wool", 20), std::vector<std::string>{"surface-96/wool"});
  EXPECT_EQ(BrokenLines("surface-96/wool", 12), (std::vector<std::string>{"surface-96/", "wool"}));
  EXPECT_EQ(BrokenLines("abcdefgh", 3), (std::vector<std::string>{"abc", "def", "gh"}));
  EXPECT_EQ(BrokenLines("", 3), std::vector<std::string>{""});
}

TEST(CaptionTest, LeavesOutWhatLiesOutside) {
  Image picture = Plain(20, 10, 4, 1.0F);
  DrawLine("\xffM", 15, -3, 2, picture);
  DrawLine("M", -4, 5, 3, picture);
  EXPECT_EQ(picture.at(19, 9)[3], 1.0F);
  EXPECT_EQ(*std::ranges::min_element(picture.pixels), 0.0F);
}

}  // namespace
}  // namespace tessera::cli
