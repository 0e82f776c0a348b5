#include "btf/metrics/image_errors.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/image/transfer.h"
#include "btf/metrics/ssim.h"

namespace tessera {
namespace {

Image Constant(int width, int height, float value) {
  Image image(width, height, 3);
  image.pixels.assign(image.pixels.size(), value);
  return image;
}

Image Noise(int width, int height, uint64_t seed) {
  Image image(width, height, 3);
  Rng rng(seed);
  for (float& value : image.pixels) {
    value = static_cast<float>(rng.NextDouble());
  }
  return image;
}

TEST(ImageErrorsTest, NothingIsWrongWithTheSame) {
  const Image image = Noise(20, 16, 1);
  ImageErrors errors;
  ASSERT_TRUE(errors.Add(image, image).ok());
  EXPECT_EQ(errors.rmse(), 0.0);
  EXPECT_EQ(errors.relative_rmse(), 0.0);
  EXPECT_EQ(errors.psnr_db(), std::numeric_limits<double>::infinity());
  EXPECT_NEAR(errors.dssim(), 0.0, 1e-6);
  EXPECT_EQ(errors.flip(), 0.0);
  EXPECT_EQ(errors.num_images(), 1);
}

TEST(ImageErrorsTest, PoolsSquaresOverPictures) {
  ImageErrors errors;
  ASSERT_TRUE(errors.Add(Constant(16, 16, 0.5F), Constant(16, 16, 0.6F)).ok());
  ImageErrors second;
  ASSERT_TRUE(second.Add(Constant(16, 16, 0.3F), Constant(16, 16, 0.3F)).ok());
  errors.Add(second);
  constexpr double kFloat = 1e-6;
  EXPECT_NEAR(errors.rmse(), 0.1 / std::sqrt(2.0), kFloat);
  EXPECT_NEAR(errors.relative_rmse(), 0.1 / std::sqrt(0.25 + 0.09), kFloat);
  const double coded = SrgbFromLinear(0.6) - SrgbFromLinear(0.5);
  EXPECT_NEAR(errors.psnr_db(), -10.0 * std::log10(coded * coded / 2.0), 1e-2);
  EXPECT_EQ(errors.num_images(), 2);
}

TEST(ImageErrorsTest, RelativeToBlackIsInfiniteUnlessMet) {
  ImageErrors met;
  ASSERT_TRUE(met.Add(Constant(8, 8, 0.0F), Constant(8, 8, 0.0F)).ok());
  EXPECT_EQ(met.relative_rmse(), 0.0);
  ImageErrors missed;
  ASSERT_TRUE(missed.Add(Constant(8, 8, 0.0F), Constant(8, 8, 0.1F)).ok());
  EXPECT_EQ(missed.relative_rmse(), std::numeric_limits<double>::infinity());
}

TEST(ImageErrorsTest, WhatIsShownIsClamped) {
  ImageErrors errors;
  ASSERT_TRUE(errors.Add(Constant(16, 16, 1.0F), Constant(16, 16, 3.0F)).ok());
  EXPECT_NEAR(errors.rmse(), 2.0, 1e-6);
  EXPECT_EQ(errors.psnr_db(), std::numeric_limits<double>::infinity());
  EXPECT_EQ(errors.flip(), 0.0);
}

TEST(ImageErrorsTest, RefusesOtherShapes) {
  ImageErrors errors;
  EXPECT_EQ(errors.Add(Constant(8, 8, 0), Constant(8, 9, 0)).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(errors.Add(Image(8, 8, 1), Image(8, 8, 1)).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(errors.Add(Image(), Image()).code(), absl::StatusCode::kInvalidArgument);
}

TEST(SsimTest, OfConstantsIsTheLuminanceTerm) {
  constexpr double kC1 = 1e-4;
  const double a = 0.2;
  const double b = 0.7;
  // Single precision: variances of constants are rounding beside C2 = 9e-4.
  EXPECT_NEAR(Ssim(Constant(16, 20, 0.2F), Constant(16, 20, 0.7F)), (2 * a * b + kC1) / (a * a + b * b + kC1),
              1e-3);
}

TEST(SsimTest, OfOneWindowMatchesItsDefinition) {
  // 11 x 11: one window, so that the formula can be written out.
  const Image a = Noise(11, 11, 3);
  const Image b = Noise(11, 11, 4);
  double expected = 0.0;
  for (int channel = 0; channel < 3; ++channel) {
    double weights = 0, ma = 0, mb = 0, aa = 0, bb = 0, ab = 0;
    for (int y = 0; y < 11; ++y) {
      for (int x = 0; x < 11; ++x) {
        const double w = std::exp(-((x - 5) * (x - 5) + (y - 5) * (y - 5)) / (2 * 1.5 * 1.5));
        const double va = a.at(x, y)[channel];
        const double vb = b.at(x, y)[channel];
        weights += w;
        ma += w * va;
        mb += w * vb;
        aa += w * va * va;
        bb += w * vb * vb;
        ab += w * va * vb;
      }
    }
    ma /= weights;
    mb /= weights;
    const double sa = aa / weights - ma * ma;
    const double sb = bb / weights - mb * mb;
    const double sab = ab / weights - ma * mb;
    expected += (2 * ma * mb + 1e-4) * (2 * sab + 9e-4) / ((ma * ma + mb * mb + 1e-4) * (sa + sb + 9e-4)) / 3;
  }
  EXPECT_NEAR(Ssim(a, b), expected, 1e-5);
  EXPECT_NEAR(Dssim(a, b), 0.5 * (1 - expected), 1e-5);
}

TEST(SsimTest, SmallPicturesHaveOneWindow) {
  EXPECT_NEAR(Ssim(Noise(4, 3, 1), Noise(4, 3, 1)), 1.0, 1e-6);
}

TEST(SsimTest, CodesLikeTheCurve) {
  Image image(256, 1, 3);
  for (int i = 0; i < 768; ++i) {
    image.pixels[i] = static_cast<float>(i) / 700.0F - 0.02F;
  }
  const Image coded = SrgbCoded(image);
  for (int i = 0; i < 768; ++i) {
    const double clamped = std::min(1.0, std::max(0.0, static_cast<double>(image.pixels[i])));
    EXPECT_NEAR(coded.pixels[i], SrgbFromLinear(clamped), 1e-5);
  }
}

}  // namespace
}  // namespace tessera
