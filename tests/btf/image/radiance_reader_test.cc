// Radiance pictures in their three layouts, and what is refused of them.
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/image/image_io.h"
#include "tests/support/image_files.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

absl::StatusOr<Image> Decode(const std::string& bytes) {
  return DecodeImage(std::as_bytes(std::span(bytes.data(), bytes.size())), "picture", std::nullopt);
}

// A header of that resolution, and `pixels` after it.
std::string File(const std::string& resolution, const std::string& pixels,
                 const std::string& variables = "FORMAT=32-bit_rle_rgbe\n") {
  return "#?RADIANCE\n" + variables + "\n" + resolution + "\n" + pixels;
}

std::string Message(const absl::StatusOr<Image>& image) {
  return std::string(image.status().message());
}

// Long and short runs in every component, black, and the extremes of the exponent.
CodeImage Rows(int width, int height) {
  CodeImage image(width, height, 4);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.at(x, y, 0) = static_cast<uint16_t>(x / 300 * 50 + 5);
      image.at(x, y, 1) = static_cast<uint16_t>((x * 37 + y) % 256);
      image.at(x, y, 2) = static_cast<uint16_t>(x % 5 == 0 ? 9 : 200);
      image.at(x, y, 3) = static_cast<uint16_t>(y == 0 ? 0 : y == 1 ? 255 : 100 + x / 100 % 60);
    }
  }
  return image;
}

TEST(RadianceReaderTest, ReadsEveryLayoutExactly) {
  for (const int width : {1, 7, 8, 300, 1200}) {
    CodeImage image = Rows(width, 4);
    for (const RadianceLayout layout :
         {RadianceLayout::kPlain, RadianceLayout::kPixelRuns, RadianceLayout::kComponentRuns}) {
      if (layout == RadianceLayout::kComponentRuns && width < 8) {
        continue;
      }
      const auto read = Decode(MakeRadiance(image, layout));
      ASSERT_TRUE(read.ok()) << read.status();
      ASSERT_EQ(read->width, width);
      ASSERT_EQ(read->height, 4);
      ASSERT_EQ(read->channels, 3);
      for (int y = 0; y < 4; ++y) {
        for (int x = 0; x < width; ++x) {
          for (int channel = 0; channel < 3; ++channel) {
            const int exponent = image.at(x, y, 3);
            const double expected = exponent == 0 ? 0.0 : std::ldexp(image.at(x, y, channel), exponent - 136);
            ASSERT_EQ(read->at(x, y)[channel], static_cast<float>(expected)) << x << ' ' << y;
          }
        }
      }
    }
  }
}

TEST(RadianceReaderTest, LongPixelRunsHaveDigits) {
  // 3 + 2 * 256 repeats of one pixel: two digits.
  std::string pixels = {10, 20, 30, static_cast<char>(136), 1, 1, 1, 3, 1, 1, 1, 2};
  const auto read = Decode(File("-Y 1 +X 516", pixels));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->at(515, 0)[2], 30.0F);
  EXPECT_EQ(Decode(File("-Y 1 +X 515", pixels)).status().code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(Decode(File("-Y 1 +X 517", pixels)).status().code(), absl::StatusCode::kDataLoss);
}

TEST(RadianceReaderTest, ExposureIsTakenOut) {
  const std::string pixel = {10, 20, 30, static_cast<char>(136)};
  const auto read = Decode(File("-Y 1 +X 1", pixel, "EXPOSURE=2\nEXPOSURE= 4.0\nCOLORCORR= 1 0.5 2\n"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_THAT(read->pixels, ::testing::ElementsAre(10.0F / 8, 20.0F / 4, 30.0F / 16));
  for (const char* bad : {"EXPOSURE=0\n", "EXPOSURE=-1\n", "EXPOSURE=nan\n", "EXPOSURE=\n", "EXPOSURE=1 2\n",
                          "EXPOSURE=1e999\n", "COLORCORR=1 2\n"}) {
    EXPECT_EQ(Decode(File("-Y 1 +X 1", pixel, bad)).status().code(), absl::StatusCode::kDataLoss) << bad;
  }
}

TEST(RadianceReaderTest, RefusesWhatItDoesNotReadByName) {
  const std::string pixel = {10, 20, 30, static_cast<char>(136)};
  EXPECT_THAT(Message(Decode(File("-Y 1 +X 1", pixel, "FORMAT=32-bit_rle_xyze\n"))),
              HasSubstr("picture: Radiance picture of format '32-bit_rle_xyze'"));
  EXPECT_THAT(Message(Decode(File("+Y 1 +X 1", pixel))), HasSubstr("'+Y 1 +X 1'"));
  EXPECT_THAT(Message(Decode(File("+X 1 -Y 1", pixel))), HasSubstr("'+X 1 -Y 1'"));
  EXPECT_THAT(Message(Decode("#?RADIUS\n\n-Y 1 +X 1\n" + pixel)), HasSubstr("not a Radiance picture"));
  EXPECT_TRUE(Decode("#?RGBE\nmade by hand\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n" + pixel).ok());
}

TEST(RadianceReaderTest, RefusesHostileSizesAndRuns) {
  for (const char* size : {"-Y 0 +X 1", "-Y 1 +X -1", "-Y 16385 +X 1", "-Y 1 +X 1000000000000"}) {
    const auto read = Decode(File(size, "...."));
    EXPECT_EQ(read.status().code(), absl::StatusCode::kInvalidArgument) << size;
    EXPECT_THAT(Message(read), HasSubstr("16384"));
  }
  for (const char* size : {"-Y 1 +X", "-Y 1 +X 99999999999999999999", "-Y one +X 1", "", "-Y 1 +X 1 1"}) {
    EXPECT_EQ(Decode(File(size, "....")).status().code(), absl::StatusCode::kDataLoss) << size;
  }
  const std::string start = {2, 2, 0, 8};
  struct Case {
    std::string pixels;
    std::string message;
  };
  const auto run = [](int count) { return std::string{static_cast<char>(128 + count), 7}; };
  for (const Case& bad : {Case{{2, 2, 0, 9, 0}, "row 0: scanline of 9 pixels, expected 8"},
                          Case{start + std::string(1, '\0'), "row 0: run of 0 pixels at 0 of 8"},
                          Case{start + run(5) + run(4), "row 0: run of 4 pixels at 5 of 8"},
                          Case{start + run(8) + std::string(1, 9), "row 0: run of 9 pixels at 0 of 8"},
                          Case{{1, 1, 1, 2}, "row 0: run of 2 pixels at 0 of 8"},
                          Case{{5, 5, 5, 5, 1, 1, 1, 8}, "row 0: run of 8 pixels at 1 of 8"},
                          Case{start + run(8), "truncated"}}) {
    const auto read = Decode(File("-Y 1 +X 8", bad.pixels));
    EXPECT_EQ(read.status().code(), absl::StatusCode::kDataLoss) << bad.message;
    EXPECT_THAT(Message(read), HasSubstr(bad.message));
  }
  // Repeats of nothing, for ever: the digits end.
  std::string zeros = {5, 5, 5, 5};
  for (int i = 0; i < 6; ++i) {
    zeros += std::string{1, 1, 1, 0};
  }
  EXPECT_EQ(Decode(File("-Y 1 +X 8", zeros)).status().code(), absl::StatusCode::kDataLoss);
}

TEST(RadianceReaderTest, RefusesEndlessHeaders) {
  EXPECT_THAT(Message(Decode("#?RADIANCE\n" + std::string(5000, 'a'))), HasSubstr("4096"));
  std::string lines = "#?RADIANCE\n";
  for (int i = 0; i < 10000; ++i) {
    lines += "VIEW=-vtv\n";
  }
  EXPECT_THAT(Message(Decode(lines)), HasSubstr("65536"));
}

}  // namespace
}  // namespace tessera
