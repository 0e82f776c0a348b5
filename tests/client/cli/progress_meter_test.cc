#include "client/cli/progress_meter.h"

#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera::cli {
namespace {

TEST(ProgressMeterTest, FormatsTimesAndAmounts) {
  EXPECT_EQ(FormatRemaining(0), "0:00");
  EXPECT_EQ(FormatRemaining(2.1), "0:03");
  EXPECT_EQ(FormatRemaining(130), "2:10");
  EXPECT_EQ(FormatRemaining(3723), "1:02:03");
  EXPECT_EQ(FormatRemaining(-5), "0:00");
  EXPECT_EQ(FormatAmount(512, "bytes"), "512 B");
  EXPECT_EQ(FormatAmount(3.4 * 1024 * 1024, "bytes"), "3.4 MiB");
  EXPECT_EQ(FormatAmount(6561, "images"), "6561 images");
  EXPECT_EQ(FormatAmount(2.5, "tiles"), "2.5 tiles");
}

TEST(ProgressMeterTest, DrawsABarWithRateAndRemainingTime) {
  testing::internal::CaptureStderr();
  {
    ProgressMeter meter(ProgressMeter::Style::kBar);
    meter.Report({"encode", 0, 8, "rows"});
    std::this_thread::sleep_for(std::chrono::milliseconds(120));
    meter.Report({"encode", 4, 8, "rows"});
  }
  const std::string shown = testing::internal::GetCapturedStderr();
  EXPECT_THAT(shown, testing::HasSubstr("[############............]  50%  4/8 rows"));
  EXPECT_THAT(shown, testing::HasSubstr("rows/s"));
  EXPECT_THAT(shown, testing::HasSubstr("0:01 left"));
}

TEST(ProgressMeterTest, LinesHaveNoControlCharacters) {
  testing::internal::CaptureStderr();
  ProgressMeter meter(ProgressMeter::Style::kLines);
  meter.Report({"check", 1, 2, "images"});
  meter.Report({"check", 2, 2, "images"});
  meter.Report({"encode", 1, 8, "rows"});
  meter.Finish();
  const std::string shown = testing::internal::GetCapturedStderr();
  EXPECT_EQ(shown.find('\r'), std::string::npos);
  EXPECT_EQ(shown.find('\033'), std::string::npos);
  EXPECT_THAT(shown, testing::HasSubstr("check"));
  ASSERT_EQ(meter.stages().size(), 2u);
  EXPECT_EQ(meter.stages()[1].stage, "encode");
}

TEST(ProgressMeterTest, SilentSaysNothingButKeepsTime) {
  testing::internal::CaptureStderr();
  ProgressMeter meter(ProgressMeter::Style::kSilent);
  meter.Report({"check", 1, 2, "images"});
  meter.Finish();
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(meter.stages().size(), 1u);
}

}  // namespace
}  // namespace tessera::cli
