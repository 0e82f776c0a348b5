#include "btf/image/transfer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

using ::testing::HasSubstr;

// IEC 61966-2-1 gives its constants to four or five digits: the two pieces of the curve meet to about 1e-8.
constexpr double kCurveTolerance = 1e-7;

TEST(TransferTest, SrgbKnownValues) {
  EXPECT_NEAR(LinearFromSrgb(0.5), 0.21404114, kCurveTolerance);
  EXPECT_NEAR(SrgbFromLinear(0.18), 0.46135612, kCurveTolerance);
  EXPECT_DOUBLE_EQ(LinearFromSrgb(0.0), 0.0);
  EXPECT_DOUBLE_EQ(LinearFromSrgb(1.0), 1.0);
}

TEST(TransferTest, EveryCurveInvertsAndIsOdd) {
  const Transfer curves[] = {Transfer::Srgb(), Transfer::Linear(), {TransferKind::kGamma, 2.2}};
  for (const Transfer& curve : curves) {
    for (int i = -300; i <= 300; ++i) {
      const double x = i / 200.0;
      EXPECT_NEAR(EncodedFromLinear(curve, LinearFromEncoded(curve, x)), x, kCurveTolerance);
      EXPECT_DOUBLE_EQ(LinearFromEncoded(curve, -x), -LinearFromEncoded(curve, x));
    }
  }
}

TEST(TransferTest, ParseReadsWhatNameWrites) {
  for (const char* text : {"srgb", "linear", "gamma:2.2", "gamma:1"}) {
    const auto transfer = ParseTransfer(text);
    ASSERT_TRUE(transfer.ok()) << transfer.status();
    EXPECT_EQ(TransferName(*transfer), text);
  }
}

TEST(TransferTest, ParseRefusesByName) {
  for (const char* text : {"", "sRGB", "gamma", "gamma:", "gamma:0", "gamma:nan", "gamma:2.2x", "gamma:99"}) {
    const auto transfer = ParseTransfer(text);
    ASSERT_FALSE(transfer.ok()) << text;
    EXPECT_EQ(transfer.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(transfer.status().message()), HasSubstr("gamma:G"));
  }
}

}  // namespace
}  // namespace tessera
