#include "btf/meso/generated_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/data/direction_sets.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

TEST(GeneratedSourceTest, ReadsBackWhatProvenanceRecords) {
  GenerateParams params{.kind = "weave", .size = 48, .seed = 9, .height_scale_texels = 2.5};
  params.views = *DirectionSet("1x2");
  params.lights = *DirectionSet("2x3");
  params.area_samples = 2;
  params.bounces = 1;
  const auto source = GenerateBtf(params, {});
  ASSERT_TRUE(source.ok()) << source.status();
  const auto read = ParseGeneratedSource((*source)->info().provenance.source + ",views=1x2,lights=2x3");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->kind, "weave");
  EXPECT_EQ(read->size, 48);
  EXPECT_EQ(read->seed, 9U);
  EXPECT_EQ(read->height_scale_texels, 2.5);
  EXPECT_EQ(read->area_samples, 2);
  EXPECT_EQ(read->bounces, 1);
  EXPECT_EQ(read->views.size(), 2U);
  EXPECT_EQ(read->lights.size(), 6U);
}

TEST(GeneratedSourceTest, DefaultsAreThoseOfTheGeneratorAndUbo81) {
  const auto read = ParseGeneratedSource("generated:holes");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->size, GenerateParams().size);
  EXPECT_EQ(read->views.size(), 81U);
  EXPECT_EQ(read->lights.size(), 81U);
}

TEST(GeneratedSourceTest, SaysWhatIsWrong) {
  const auto message = [](std::string_view text) {
    return std::string(ParseGeneratedSource(text).status().message());
  };
  EXPECT_THAT(message("generated:marble"), HasSubstr("reactdiffuse"));
  EXPECT_THAT(message("generated:weave,colour-scale=2"), HasSubstr("colour-scale"));
  EXPECT_THAT(message("generated:weave,size=big"), HasSubstr("size=big"));
  EXPECT_THAT(message("generated:weave,size"), HasSubstr("key=value"));
  EXPECT_THAT(message("generated:weave,size=64,size=64"), HasSubstr("twice"));
  EXPECT_THAT(message("generated:weave,size=8"), HasSubstr("32"));
  EXPECT_THAT(message("generated:weave,lights=82"), HasSubstr("ubo81"));
  EXPECT_THAT(message("weave"), HasSubstr("generated:KIND"));
  EXPECT_EQ(ParseGeneratedSource("generated:heightmap,height=/none.png").status().code(),
            absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace tessera
