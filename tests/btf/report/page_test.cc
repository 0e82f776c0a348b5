#include "btf/report/page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST(PageTest, CsvQuotesWhatNeedsIt) {
  EXPECT_EQ(CsvLine({"a", "b, c", "say \"x\"", "", "two\nlines"}),
            "a,\"b, c\",\"say \"\"x\"\"\",,\"two\nlines\"\n");
}

TEST(PageTest, TextIsEscaped) {
  EXPECT_EQ(HtmlEscaped("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
  EXPECT_THAT(HtmlPage("x<y", "", "<p>body</p>"), HasSubstr("<title>x&lt;y</title>"));
}

TEST(PageTest, PicturesAreEmbedded) {
  Image image(2, 1, 3);
  image.pixels[0] = 1.0F;
  const auto uri = PngDataUri(image);
  ASSERT_TRUE(uri.ok());
  EXPECT_THAT(*uri, StartsWith("data:image/png;base64,iVBORw0KGgo"));
  EXPECT_FALSE(PngDataUri(Image()).ok());
}

}  // namespace
}  // namespace tessera
