#include "btf/data/subset_btf.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/data/half_btf.h"
#include "tests/support/btf_files.h"
#include "tests/support/read_btf.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::unique_ptr<MemoryBtf> SubsettedBtf() {
  return AsymmetricBtf(5, 4, WholeDegreeDirections(2, 3), WholeDegreeDirections(3, 4));
}

TEST(SubsetBtfTest, EveryFifthDirectionIsHeldOut) {
  EXPECT_THAT(HeldOutDirections(15), ElementsAre(4, 9, 14));
  EXPECT_THAT(HeldOutDirections(4), ElementsAre());
  EXPECT_THAT(KeptDirections(7), ElementsAre(0, 1, 2, 3, 5, 6));
  EXPECT_EQ(HeldOutDirections(81).size() + KeptDirections(81).size(), 81u);
}

TEST(SubsetBtfTest, HoldsTheSourcesSamples) {
  const auto btf = SubsettedBtf();
  const BtfSubset kept{.views = {1, 4}, .lights = {0, 3, 7, 8}, .columns = {0, 3}, .rows = {1, 2, 3}};
  const auto subset = SubsetBtf::Create(*btf, kept);
  ASSERT_TRUE(subset.ok()) << subset.status();
  ASSERT_EQ((*subset)->info().width, 2);
  ASSERT_EQ((*subset)->info().height, 3);
  ASSERT_EQ((*subset)->info().views.size(), 2u);
  EXPECT_EQ((*subset)->info().views[1].phi_rad, btf->info().views[4].phi_rad);
  EXPECT_EQ((*subset)->info().lights[2].theta_rad, btf->info().lights[7].theta_rad);
  for (const int rows_at_a_time : {1, 2, 3}) {
    const std::vector<float> samples = AllSamples(**subset, rows_at_a_time);
    size_t index = 0;
    for (const int y : kept.rows) {
      for (const int x : kept.columns) {
        for (int channel = 0; channel < 3; ++channel) {
          for (const int view : kept.views) {
            for (const int light : kept.lights) {
              ASSERT_EQ(samples[index++], btf->at(x, y, channel, view, light));
            }
          }
        }
      }
    }
    ASSERT_EQ(index, samples.size());
  }
}

TEST(SubsetBtfTest, EmptyKeepsAll) {
  const auto btf = SubsettedBtf();
  const auto subset = SubsetBtf::Create(*btf, {});
  ASSERT_TRUE(subset.ok());
  EXPECT_EQ(AllSamples(**subset), AllSamples(*btf));
}

TEST(SubsetBtfTest, NamesTheIndexThatIsWrong) {
  const auto btf = SubsettedBtf();
  EXPECT_THAT(std::string(SubsetBtf::Create(*btf, {.views = {0, 99}}).status().message()),
              HasSubstr("view 99"));
  EXPECT_THAT(std::string(SubsetBtf::Create(*btf, {.lights = {3, 3}}).status().message()),
              HasSubstr("light 3 after 3"));
  EXPECT_THAT(std::string(SubsetBtf::Create(*btf, {.rows = {-1}}).status().message()), HasSubstr("row -1"));
}

TEST(HalfBtfTest, RoundsToElevenBits) {
  const auto btf = SubsettedBtf();
  const auto half = HalfBtf::CopyOf(*btf, 1 << 20, {});
  ASSERT_TRUE(half.ok()) << half.status();
  const std::vector<float> expected = AllSamples(*btf);
  const std::vector<float> samples = AllSamples(**half, 3);
  constexpr float kHalfUlp = 0x1p-11F;
  constexpr float kLeastNormal = 0x1p-14F;  // below it, steps are absolute
  for (size_t i = 0; i < expected.size(); ++i) {
    ASSERT_LE(std::abs(samples[i] - expected[i]), kHalfUlp * std::max(kLeastNormal, expected[i]));
  }
}

TEST(HalfBtfTest, SpilledSamplesAreThoseInMemory) {
  const auto btf = SubsettedBtf();
  const TempFolder folder;
  const auto half = HalfBtf::CopyOf(*btf, 1 << 20, {});
  ASSERT_TRUE(half.ok()) << half.status();
  const auto spilled = HalfBtf::SpillingCopyOf(*btf, HalfBtf::SizeBytes(*btf) - 1, folder.path(), {});
  ASSERT_TRUE(spilled.ok()) << spilled.status();
  EXPECT_EQ(AllSamples(**spilled, 1), AllSamples(**half));
  EXPECT_EQ(AllSamples(**spilled, 3), AllSamples(**half));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));  // the file has no name
  // What memory holds needs no folder.
  EXPECT_TRUE(HalfBtf::SpillingCopyOf(*btf, 1 << 20, folder.path() / "none", {}).ok());
  EXPECT_FALSE(HalfBtf::SpillingCopyOf(*btf, 0, folder.path() / "none", {}).ok());
}

TEST(HalfBtfTest, RefusesWhatExceedsTheLimit) {
  const auto btf = SubsettedBtf();
  const auto half = HalfBtf::CopyOf(*btf, HalfBtf::SizeBytes(*btf) - 1, {});
  EXPECT_EQ(half.status().code(), absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace tessera
