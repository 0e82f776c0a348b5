#include "client/cli/describe.h"

#include <gtest/gtest.h>

namespace tessera::cli {
namespace {

TEST(DescribeTest, EmbeddedJsonIsAnObjectAndNamesAreShort) {
  v1::TileSet tile_set;
  tile_set.set_name("arrangements/surface-96/tileSets/wool");
  tile_set.set_certificate_json(R"({"limit": 2, "borders": {"ratio": 1.5}})");
  tile_set.set_metadata_json("not json");
  const Json described = Describe(tile_set);
  EXPECT_EQ(described["name"], "surface-96/wool");
  EXPECT_EQ(described["certificate"]["borders"]["ratio"], 1.5);
  EXPECT_EQ(described["metadata"], "not json");
  EXPECT_EQ(described["create_time"], "");
}

TEST(DescribeTest, OnlyFailedJobsHaveAnError) {
  v1::Job job;
  job.set_name("jobs/4");
  job.set_kind("synthesize");
  job.set_state(v1::Job::RUNNING);
  job.mutable_progress()->set_stage("tiles");
  job.mutable_progress()->set_done(3);
  job.mutable_progress()->set_total(96);
  job.mutable_progress()->set_unit("tiles");
  EXPECT_FALSE(Describe(job).contains("error"));
  EXPECT_EQ(JobLine(job), "4 synthesize RUNNING tiles 3/96 tiles");
  job.set_state(v1::Job::FAILED);
  job.mutable_error()->set_message("too small");
  job.mutable_error()->mutable_detail()->set_reason("MATERIAL_TOO_SMALL");
  EXPECT_EQ(Describe(job)["error"]["reason"], "MATERIAL_TOO_SMALL");
  EXPECT_EQ(JobLine(job), "4 synthesize FAILED: too small");
}

TEST(DescribeTest, TablesAndRecordsAlign) {
  EXPECT_EQ(TextTable({{"A", "B"}, {"long", "x"}}), "A     B\nlong  x");
  EXPECT_EQ(TextRecord(Json{{"a", 1}, {"b", {{"c", 0.123456789}}}, {"empty", ""}, {"list", {1, 2}}}),
            "a:     1\nb.c:   0.12346\nlist:  1 2");
  EXPECT_EQ(TextRecord(Json{{"pairs", {{{"light_deg", 15}}, {{"light_deg", 45}}}}}),
            "pairs.0:  {\"light_deg\":15}\npairs.1:  {\"light_deg\":45}");
  EXPECT_EQ(
      TextRecord(Json{
          {"told", {"one thing", "and another"}}, {"words", {"red", "green"}}, {"empty", Json::array()}}),
      "told:   one thing\ntold:   and another\nwords:  red green");
}

}  // namespace
}  // namespace tessera::cli
