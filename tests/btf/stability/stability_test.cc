// Every row of the stability table keeps its promise.
#include "btf/stability/stability.h"

#include <set>
#include <stop_token>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

using ::testing::HasSubstr;

TEST(StabilityTest, EveryRowHoldsAndEveryCodecHasRows) {
  const auto rows = RunStability({});
  ASSERT_TRUE(rows.ok()) << rows.status();
  std::set<std::string> methods;
  for (const StabilityRow& row : *rows) {
    methods.insert(row.method);
  }
  for (const std::string_view codec : CodecIds()) {
    EXPECT_EQ(methods.count(std::string(codec)), 1U) << codec;
  }
  for (const StabilityRow& row : *rows) {
    EXPECT_TRUE(row.holds) << StabilityCsv({row});
  }
}

TEST(StabilityTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  RunContext context;
  context.stop = stop.get_token();
  EXPECT_EQ(RunStability(context).status().code(), absl::StatusCode::kCancelled);
}

TEST(StabilityReportTest, QuotesAndEscapes) {
  StabilityRow row;
  row.stress = "a, \"b\"";
  row.method = "x<y";
  row.is_refused = true;
  row.holds = true;
  const std::string csv = StabilityCsv({row});
  EXPECT_THAT(csv, HasSubstr("\"a, \"\"b\"\"\",x<y,,refused,"));
  EXPECT_THAT(StabilityHtml({row}), HasSubstr("x&lt;y"));
}

}  // namespace
}  // namespace tessera
