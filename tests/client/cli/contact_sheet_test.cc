#include "client/cli/contact_sheet.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace tessera::cli
