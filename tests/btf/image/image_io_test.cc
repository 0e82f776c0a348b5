#include "btf/image/image_io.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/image_files.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

std::span<const std::byte> Bytes(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

Image Ramp(int width, int height, int channels) {
  Image image(width, height, channels);
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    image.pixels[i] = static_cast<float>(i % 97) / 96.0f;
  }
  return image;
}

class ChannelsTest : public ::testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(All, ChannelsTest, ::testing::Values(1, 3, 4));

TEST_P(ChannelsTest, PngRoundTripWithinHalfACode) {
  const Image image = Ramp(13, 7, GetParam());
  const auto bytes = EncodePng(image);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  const auto back = DecodeImage(Bytes(*bytes), "ramp", std::nullopt);
  ASSERT_TRUE(back.ok()) << back.status();
  EXPECT_EQ(back->width, 13);
  EXPECT_EQ(back->height, 7);
  ASSERT_EQ(back->channels, GetParam());
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    const bool alpha = GetParam() == 4 && i % 4 == 3;
    const double a = alpha ? image.pixels[i] : SrgbFromLinear(image.pixels[i]);
    const double b = alpha ? back->pixels[i] : SrgbFromLinear(back->pixels[i]);
    ASSERT_NEAR(a, b, 0.5001 / 255.0) << i;
  }
}

TEST_P(ChannelsTest, ExrFloatRoundTripIsExact) {
  Image image = Ramp(20, 33, GetParam());
  image.pixels[5] = 1234.5f;
  image.pixels[6] = -0.25f;
  const auto bytes = EncodeExr(image, ExrDepth::kFloat);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  const auto back = DecodeImage(Bytes(*bytes), "ramp", std::nullopt);
  ASSERT_TRUE(back.ok()) << back.status();
  ASSERT_EQ(back->channels, GetParam());
  EXPECT_EQ(back->pixels, image.pixels);
}

TEST(ImageIoTest, ExrHalfRoundTripWithinHalfPrecision) {
  const Image image = Ramp(20, 33, 3);
  const auto bytes = EncodeExr(image);
  ASSERT_TRUE(bytes.ok());
  const auto back = DecodeImage(Bytes(*bytes), "ramp", std::nullopt);
  ASSERT_TRUE(back.ok()) << back.status();
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    ASSERT_NEAR(back->pixels[i], image.pixels[i], image.pixels[i] * 0x1p-11 + 0x1p-24);
  }
}

TEST(ImageIoTest, TransferOverridesTheDefault) {
  CodeImage codes(2, 1, 1);
  codes.at(0, 0, 0) = 128;
  codes.at(1, 0, 0) = 255;
  const std::string png = MakePng(codes, 8);
  const double x = 128.0 / 255.0;
  EXPECT_FLOAT_EQ(DecodeImage(Bytes(png), "a", std::nullopt)->pixels[0], LinearFromSrgb(x));
  EXPECT_FLOAT_EQ(DecodeImage(Bytes(png), "a", Transfer::Linear())->pixels[0], x);
  EXPECT_FLOAT_EQ(DecodeImage(Bytes(png), "a", Transfer{TransferKind::kGamma, 2.2})->pixels[0],
                  std::pow(x, 2.2));
}

TEST(ImageIoTest, EncodePngClampsAndMapsNanToZero) {
  Image image(3, 1, 1);
  image.pixels = {std::numeric_limits<float>::quiet_NaN(), -1.0f, 7.0f};
  const auto png = EncodePng(image);
  ASSERT_TRUE(png.ok());
  EXPECT_THAT(DecodeImage(Bytes(*png), "a", std::nullopt)->pixels, ::testing::ElementsAre(0.0f, 0.0f, 1.0f));
}

TEST(ImageIoTest, EncodersRefuseBadShapes) {
  Image image(2, 2, 3);
  image.pixels.pop_back();
  EXPECT_EQ(EncodePng(image).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(EncodeExr(image).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(EncodePng(Image(2, 2, 2)).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(EncodePng(Image()).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ImageIoTest, ReadImageNamesTheFile) {
  const auto missing = ReadImage("/nonexistent/a.png", std::nullopt);
  EXPECT_EQ(missing.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(missing.status().message()), HasSubstr("/nonexistent/a.png"));
  EXPECT_EQ(ReadImage("/tmp", std::nullopt).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera
