#include "btf/chart/pictures.h"

#include <set>

#include <gtest/gtest.h>

#include "btf/data/direction_sets.h"
#include "btf/measure/held_out.h"
#include "btf/metrics/flip.h"
#include "btf/metrics/ssim.h"
#include "tests/support/noise_btf.h"
#include "tests/support/read_btf.h"

namespace tessera {
namespace {

TEST(AngleLimitsTest, BothAnglesCountAndLimitsAreInclusive) {
  const auto at = [](double degrees) { return Direction{RadFromDeg(degrees), 1.0}; };
  EXPECT_EQ(AngleClass(at(0), at(45)), 0U);
  EXPECT_EQ(AngleClass(at(45), at(46)), 1U);
  EXPECT_EQ(AngleClass(at(60), at(15)), 1U);
  EXPECT_EQ(AngleClass(at(10), at(75)), 2U);
  EXPECT_EQ(AngleClass(at(75.1), at(0)), 3U);
  EXPECT_EQ(AngleClass(at(90), at(90)), 3U);
}

BtfInfo Ubo() {
  BtfInfo info;
  info.views = *DirectionSet("ubo81");
  info.lights = *DirectionSet("ubo81");
  return info;
}

TEST(PicturesTest, EveryClassIsThereAndTheChoiceIsFixed) {
  const BtfInfo info = Ubo();
  const PairSet pairs = MeasuredPairs(info, Split::kHeldOutLights);
  const auto population = PairsByClass(info, pairs);
  EXPECT_EQ(population[0] + population[1] + population[2] + population[3], 16 * 81);
  EXPECT_EQ(population[3], 0);
  const std::vector<PicturePair> chosen = ChoosePictures(info, pairs, 20);
  ASSERT_EQ(chosen.size(), 60U);
  std::set<std::pair<int, int>> different;
  std::set<int> views;
  for (size_t i = 0; i < chosen.size(); ++i) {
    EXPECT_EQ(chosen[i].angle_class, i / 20);
    EXPECT_EQ(chosen[i].angle_class, AngleClass(info.views[chosen[i].view], info.lights[chosen[i].light]));
    EXPECT_EQ(chosen[i].light % 5, 4);
    different.insert({chosen[i].view, chosen[i].light});
    views.insert(chosen[i].view);
  }
  EXPECT_EQ(different.size(), 60U);
  EXPECT_GT(views.size(), 25U);  // spread, not the first ones
  const std::vector<PicturePair> all = ChoosePictures(info, pairs, 100'000);
  EXPECT_EQ(all.size(), pairs.size());
}

TEST(PicturesTest, ReadsPicturesOfTheirPair) {
  NoiseBtf source(5, 4, *DirectionSet("1x3"), *DirectionSet("2x2"));
  const std::vector<float> samples = AllSamples(source);
  const std::vector<PicturePair> pairs = {{2, 1, 0}, {0, 3, 0}};
  const auto pictures = ReadPictures(source, pairs, {});
  ASSERT_TRUE(pictures.ok());
  for (size_t i = 0; i < pairs.size(); ++i) {
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 5; ++x) {
        for (int c = 0; c < 3; ++c) {
          EXPECT_EQ((*pictures)[i].at(x, y)[c],
                    samples[(((y * 5 + x) * 3 + c) * 3 + pairs[i].view) * 4 + pairs[i].light]);
        }
      }
    }
  }
}

TEST(PicturesTest, ClassesCountByTheirPairs) {
  // One picture of a class of 30 pairs, two of a class of 10.
  const std::vector<PicturePair> pairs = {{0, 0, 0}, {0, 1, 1}, {0, 2, 1}};
  std::vector<Image> references(3, Image(12, 12, 3));
  std::vector<double> dssim;
  std::vector<double> flip;
  const PicturePredictor predict = [&](size_t i, Image& picture) {
    for (size_t p = 0; p < picture.pixels.size(); ++p) {
      picture.pixels[p] = 0.1F * static_cast<float>((i + 1) * (p % 5));
    }
  };
  for (size_t i = 0; i < 3; ++i) {
    Image picture(12, 12, 3);
    predict(i, picture);
    dssim.push_back(Dssim(SrgbCoded(references[i]), SrgbCoded(picture)));
    flip.push_back(Flip(references[i], picture));
  }
  const auto errors = ComparePictures(references, pairs, {30, 10, 0, 0}, predict, {});
  ASSERT_TRUE(errors.ok());
  EXPECT_NEAR((*errors)[0].dssim, dssim[0], 1e-12);
  EXPECT_EQ((*errors)[0].num_pictures, 1);
  EXPECT_NEAR((*errors)[1].dssim, (30 * dssim[0] + 10 * (dssim[1] + dssim[2]) / 2) / 40, 1e-12);
  EXPECT_NEAR((*errors)[3].flip, (30 * flip[0] + 10 * (flip[1] + flip[2]) / 2) / 40, 1e-12);
  EXPECT_EQ((*errors)[3].num_pictures, 3);
}

}  // namespace
}  // namespace tessera
