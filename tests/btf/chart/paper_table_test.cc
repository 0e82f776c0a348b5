#include "btf/chart/paper_table.h"

#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tessera {
namespace {

using ::testing::HasSubstr;

TEST(PaperTableTest, CsvHasThePaperAndOurs) {
  PaperRow row{.side = 128, .kv = 36, .kl = 25, .paper_s = 761.0, .paper_rate = 0.1373};
  EXPECT_EQ(row.RawBytes(), 322'486'272U);  // "321MB"
  row.runs.push_back({.method = "dsh",
                      .encode_s = 2.0,
                      .encode_cpu_s = 3.5,
                      .size_bytes = 44'000'000,
                      .relative_rmse = 0.1});
  const std::string csv = PaperCsv({row});
  EXPECT_THAT(csv, HasSubstr("128x128,81,81,36,25,322486272,paper,761,,,0.1373,\n"));
  EXPECT_THAT(csv, HasSubstr("128x128,81,81,36,25,322486272,dsh,2.000,3.500,44000000,0.136440,0.10000\n"));
}

TEST(PaperTableTest, StopsWhenAsked) {
  std::stop_source stop;
  stop.request_stop();
  RunContext context;
  context.stop = stop.get_token();
  EXPECT_EQ(RunPaperTable(PaperSize::kAll, context).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
