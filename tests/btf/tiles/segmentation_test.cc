#include "btf/tiles/segmentation.h"

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/btf/tiles/disc_exemplar.h"

namespace tessera {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 48;
constexpr int kHeight = 40;
constexpr Disc kDisc{14.0, 12.0, 5.0};
constexpr Disc kOther{34.0, 27.0, 5.0};

// Share of the texels of disc or mask that lie in both.
double Overlap(const std::vector<uint8_t>& mask, const Disc& disc) {
  int both = 0;
  int either = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool in_mask = mask[y * kWidth + x] != 0;
      both += in_mask && disc.Covers(x, y) ? 1 : 0;
      either += in_mask || disc.Covers(x, y) ? 1 : 0;
    }
  }
  return static_cast<double>(both) / either;
}

std::vector<uint8_t> Segment(const SegmentationGuide& guide) {
  const auto mask = SegmentFeature(DiscEmbedding(kWidth, kHeight, 3, {kDisc, kOther}), guide);
  EXPECT_TRUE(mask.ok()) << mask.status();
  return mask.ok() ? *mask : std::vector<uint8_t>(kWidth * kHeight);
}

TEST(SegmentationTest, ARectangleFindsTheDiscInIt) {
  EXPECT_GT(Overlap(Segment({.rectangle = Window{5, 3, 19, 19}}), kDisc), 0.95);
}

TEST(SegmentationTest, ARectangleFindsTheDiscInItThoughManyLookTheSame) {
  std::vector<Disc> discs;
  for (const double y : {6.0, 20.0, 34.0}) {
    for (const double x : {8.0, 24.0, 40.0}) {
      discs.push_back({x, y, 4.2});
    }
  }
  const auto mask =
      SegmentFeature(DiscEmbedding(kWidth, kHeight, 3, discs), {.rectangle = Window{18, 14, 13, 13}});
  ASSERT_TRUE(mask.ok()) << mask.status();
  EXPECT_GT(Overlap(*mask, discs[4]), 0.95);
}

TEST(SegmentationTest, AStrokeFindsItsDiscAndNotTheOtherThatLooksTheSame) {
  const std::vector<uint8_t> mask = Segment({.feature = {{{12, 12}, {16, 12}}}});
  EXPECT_GT(Overlap(mask, kDisc), 0.95);
  EXPECT_EQ(mask[27 * kWidth + 34], 0);
  const std::vector<uint8_t> both = Segment({.feature = {{{12, 12}, {16, 12}}, {{34, 27}}}});
  EXPECT_EQ(both[27 * kWidth + 34], 1);
  EXPECT_EQ(both[12 * kWidth + 14], 1);
}

TEST(SegmentationTest, StrokesWinOverWhatTexelsLookLike) {
  const std::vector<uint8_t> mask =
      Segment({.feature = {{{12, 12}, {16, 12}}}, .background = {{{14, 7}, {14, 10}}}});
  for (int y = 7; y <= 10; ++y) {
    EXPECT_EQ(mask[y * kWidth + 14], 0) << y;
  }
  const std::vector<uint8_t> reaching = Segment({.feature = {{{12, 12}, {26, 12}}}});
  for (int x = 12; x <= 26; ++x) {
    EXPECT_EQ(reaching[12 * kWidth + x], 1) << x;
  }
}

TEST(SegmentationTest, WhatAFeatureEnclosesBelongsToItUnlessAStrokeSaysNot) {
  Embedding embedding = DiscEmbedding(kWidth, kHeight, 3, {kDisc});
  const size_t middle = (size_t{12} * kWidth + 14) * embedding.dims;
  embedding.values[middle] -= 1.5f;
  SegmentationGuide guide{.feature = {{{12, 12}}, {{16, 12}}}};
  EXPECT_EQ((*SegmentFeature(embedding, guide))[12 * kWidth + 14], 1);
  guide.background = {{{14, 12}}};
  EXPECT_EQ((*SegmentFeature(embedding, guide))[12 * kWidth + 14], 0);
}

TEST(SegmentationTest, RefusesWhatCannotBeNamingIt) {
  const Embedding embedding = DiscEmbedding(kWidth, kHeight, 3, {kDisc});
  const auto message = [&](const SegmentationGuide& guide) {
    const auto mask = SegmentFeature(embedding, guide);
    EXPECT_EQ(mask.status().code(), absl::StatusCode::kInvalidArgument);
    return std::string(mask.status().message());
  };
  EXPECT_THAT(message({}), HasSubstr("neither a rectangle nor a stroke"));
  EXPECT_THAT(message({.background = {{{1, 1}}}}), HasSubstr("neither a rectangle nor a stroke"));
  EXPECT_THAT(message({.feature = {{{48, 12}}}}),
              HasSubstr("point (48, 12): not inside the exemplar, 48x40"));
  EXPECT_THAT(message({.feature = {{}}}), HasSubstr("a stroke without points"));
  EXPECT_THAT(message({.rectangle = Window{40, 3, 9, 9}}), HasSubstr("rectangle 9x9 at (40, 3): not inside"));
  EXPECT_THAT(message({.rectangle = Window{4, 3, 0, 9}}), HasSubstr("rectangle 0x9"));
  EXPECT_THAT(message({.feature = {{{1, 1}, {9, 1}}}, .background = {{{5, 0}, {5, 4}}}}),
              HasSubstr("texel (5, 1): strokes of the feature and of the background cross"));
  EXPECT_THAT(message({.feature = {{{1, 1}}}, .rectangle = Window{4, 3, 9, 9}}),
              HasSubstr("texel (1, 1): a stroke of the feature leaves the rectangle"));
  EXPECT_THAT(message({.rectangle = Window{0, 0, kWidth, kHeight}}), HasSubstr("every texel is the feature"));
}

TEST(SegmentationTest, SaysWhenNothingIsFoundAndWhichTexelIsNotFinite) {
  Embedding embedding = BumpyEmbedding(kWidth, kHeight, 3);
  std::fill(embedding.values.begin(), embedding.values.end(), 0.25f);
  const auto nothing = SegmentFeature(embedding, {.rectangle = Window{5, 3, 19, 19}});
  EXPECT_THAT(std::string(nothing.status().message()), HasSubstr("no texel is the feature"));
  embedding.values[(size_t{7} * kWidth + 9) * embedding.dims] = std::numeric_limits<float>::quiet_NaN();
  const auto broken = SegmentFeature(embedding, {.rectangle = Window{5, 3, 19, 19}});
  EXPECT_THAT(std::string(broken.status().message()),
              HasSubstr("texel (9, 7) of the embedding is not finite"));
}

}  // namespace
}  // namespace tessera
