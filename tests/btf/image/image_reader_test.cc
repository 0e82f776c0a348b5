#include "btf/image/image_reader.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/image/image_io.h"
#include "tests/support/image_files.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

CodeImage Pattern(int width, int height, int channels, int max_code) {
  CodeImage image(width, height, channels);
  for (size_t i = 0; i < image.codes.size(); ++i) {
    image.codes[i] = static_cast<uint16_t>((i * 2654435761u >> 7) % (max_code + 1));
  }
  return image;
}

// Smooth, so that JPEG keeps it.
CodeImage Gradient(int width, int height, int channels) {
  CodeImage image(width, height, channels);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int channel = 0; channel < channels; ++channel) {
        image.at(x, y, channel) = static_cast<uint16_t>(40 + 2 * x + y + 20 * channel);
      }
    }
  }
  return image;
}

// Red, green, blue and exponent, with runs of several lengths; never a pixel that means a run.
CodeImage RgbePattern(int width, int height) {
  CodeImage image(width, height, 4);
  for (int i = 0; i < width * height; ++i) {
    const int run = i / 7 % 3 == 0 ? i : i / 7;
    for (int channel = 0; channel < 4; ++channel) {
      const unsigned code = (run * 4 + channel) * 2654435761u >> 9;
      image.codes[4 * i + channel] = static_cast<uint16_t>(channel == 3 ? 120 + code % 20 : 3 + code % 253);
    }
  }
  return image;
}

absl::StatusOr<std::unique_ptr<ImageReader>> Open(const std::string& bytes, AlphaUse alpha = AlphaUse::kKeep,
                                                  uint64_t limit = uint64_t{1} << 30) {
  return OpenImage(MakeMemoryStream(bytes), "picture", {.alpha = alpha, .memory_limit_bytes = limit});
}

absl::Status ReadToEnd(const std::string& bytes) {
  auto reader = Open(bytes);
  if (!reader.ok()) {
    return reader.status();
  }
  std::vector<std::byte> row(RowBytes((*reader)->header()));
  for (int y = 0; y < (*reader)->header().height; ++y) {
    if (absl::Status status = (*reader)->ReadRows(1, row); !status.ok()) {
      return status;
    }
  }
  return absl::OkStatus();
}

// All codes, read in bands of three rows.
std::vector<uint16_t> ReadCodes(ImageReader& reader) {
  const ImageHeader& header = reader.header();
  std::vector<uint16_t> codes;
  for (int y = 0; y < header.height; y += 3) {
    const int num_rows = std::min(3, header.height - y);
    std::vector<std::byte> rows(num_rows * RowBytes(header));
    const absl::Status status = reader.ReadRows(num_rows, rows);
    EXPECT_TRUE(status.ok()) << status;
    for (size_t i = 0; i < rows.size(); i += SampleBytes(header.type)) {
      uint16_t code = 0;
      std::memcpy(&code, &rows[i], SampleBytes(header.type));
      codes.push_back(code);
    }
  }
  return codes;
}

struct PngCase {
  int channels;
  int bits;
  PngLayout layout;
};
class PngTest : public ::testing::TestWithParam<PngCase> {};
INSTANTIATE_TEST_SUITE_P(
    All, PngTest,
    ::testing::Values(PngCase{1, 8, PngLayout::kPlain}, PngCase{1, 16, PngLayout::kPlain},
                      PngCase{3, 8, PngLayout::kPlain}, PngCase{3, 16, PngLayout::kPlain},
                      PngCase{4, 8, PngLayout::kPlain}, PngCase{4, 16, PngLayout::kPlain},
                      PngCase{3, 8, PngLayout::kInterlaced}, PngCase{3, 16, PngLayout::kInterlaced}));

TEST_P(PngTest, CodesComeBackExactly) {
  const auto [channels, bits, layout] = GetParam();
  const CodeImage image = Pattern(17, 11, channels, bits == 8 ? 255 : 65535);
  const auto reader = Open(MakePng(image, bits, layout));
  ASSERT_TRUE(reader.ok()) << reader.status();
  EXPECT_EQ((*reader)->header().channels, channels);
  EXPECT_EQ((*reader)->header().type, bits == 8 ? SampleType::kU8 : SampleType::kU16);
  EXPECT_EQ(ReadCodes(**reader), image.codes);
}

TEST(ImageReaderTest, AlphaIsDroppedOnRequest) {
  CodeImage rgba = Pattern(5, 4, 4, 255);
  const auto reader = Open(MakePng(rgba, 8), AlphaUse::kDrop);
  ASSERT_TRUE(reader.ok());
  ASSERT_EQ((*reader)->header().channels, 3);
  const std::vector<uint16_t> codes = ReadCodes(**reader);
  EXPECT_EQ(codes[3 * 7 + 1], rgba.codes[4 * 7 + 1]);

  const CodeImage gray_alpha = Pattern(5, 4, 2, 255);
  const auto gray = Open(MakePng(gray_alpha, 8), AlphaUse::kDrop);
  ASSERT_TRUE(gray.ok());
  ASSERT_EQ((*gray)->header().channels, 1);
  EXPECT_EQ(ReadCodes(**gray)[7], gray_alpha.codes[2 * 7]);
  const auto kept = Open(MakePng(gray_alpha, 8));
  ASSERT_TRUE(kept.ok());
  ASSERT_EQ((*kept)->header().channels, 4);
  EXPECT_EQ(ReadCodes(**kept)[4 * 7 + 3], gray_alpha.codes[2 * 7 + 1]);
}

TEST(ImageReaderTest, JpegIsCloseAndProgressiveEqualsBaseline) {
  for (const int channels : {1, 3}) {
    const CodeImage image = Gradient(37, 29, channels);
    const auto baseline = Open(MakeJpeg(image));
    ASSERT_TRUE(baseline.ok()) << baseline.status();
    EXPECT_EQ((*baseline)->header().channels, channels);
    EXPECT_EQ((*baseline)->working_bytes(), 0u);
    const std::vector<uint16_t> codes = ReadCodes(**baseline);
    ASSERT_EQ(codes.size(), image.codes.size());
    // Quality 100 on a smooth image: rounding of the transform and of the colour conversion.
    for (size_t i = 0; i < codes.size(); ++i) {
      ASSERT_NEAR(codes[i], image.codes[i], 3) << i;
    }
    const auto progressive = Open(MakeJpeg(image, JpegLayout::kProgressive));
    ASSERT_TRUE(progressive.ok()) << progressive.status();
    EXPECT_GT((*progressive)->working_bytes(), 0u);
    EXPECT_EQ(ReadCodes(**progressive), codes);
  }
}

TEST(ImageReaderTest, CmykJpegIsRefusedByName) {
  const auto reader = Open(MakeJpeg(Gradient(16, 16, 4)));
  EXPECT_EQ(reader.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(reader.status().message()), HasSubstr("picture: CMYK JPEG"));
}

TEST(ImageReaderTest, OversizedAndEmptyImagesAreRefused) {
  for (const auto& [width, height] :
       {std::pair(16385, 4), std::pair(4, 16385), std::pair(1 << 30, 1 << 30)}) {
    const auto reader = Open(MakePngHeader(width, height, 3, 8));
    EXPECT_EQ(reader.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(reader.status().message()), HasSubstr("16384"));
  }
  EXPECT_TRUE(Open(MakePngHeader(16384, 16384, 3, 16)).ok());
  EXPECT_FALSE(Open("").ok());
  EXPECT_FALSE(Open("GIF89a............").ok());
}

TEST(ImageReaderTest, HostileExrWindowsAreRefused) {
  const std::string good = *EncodeExr(Image(8, 8, 3));
  const size_t window = good.find("dataWindow") + sizeof("dataWindow") + sizeof("box2i") + sizeof(int32_t);
  const auto with_window = [&](std::array<int32_t, 4> corners) {  // x min, y min, x max, y max
    std::string bytes = good;
    std::memcpy(bytes.data() + window, corners.data(), sizeof(corners));
    return ReadToEnd(bytes);
  };
  EXPECT_TRUE(with_window({0, 0, 7, 7}).ok());
  constexpr int32_t kMax = std::numeric_limits<int32_t>::max();
  for (const std::array<int32_t, 4>& corners :
       {std::array{0, 0, 7, kMax - 1}, std::array{0, 0, kMax - 1, 7}, std::array{-kMax, -kMax, kMax, kMax},
        std::array{0, 0, 7, 1 << 20}, std::array{0, 0, 7, 16384}, std::array{7, 7, 0, 0}}) {
    const absl::Status status = with_window(corners);
    EXPECT_FALSE(status.ok());
    EXPECT_THAT(std::string(status.message()), HasSubstr("picture"));
  }
}

TEST(ImageReaderTest, WholeImageFormatsStayWithinTheLimit) {
  const CodeImage image = Gradient(64, 64, 3);
  for (const std::string& bytes :
       {MakePng(image, 8, PngLayout::kInterlaced), MakeJpeg(image, JpegLayout::kProgressive)}) {
    EXPECT_EQ(Open(bytes, AlphaUse::kKeep, 4096).status().code(), absl::StatusCode::kResourceExhausted);
  }
  EXPECT_TRUE(Open(MakePng(image, 8), AlphaUse::kKeep, 4096).ok());
}

// Every file of the formats under test, small and whole.
std::vector<std::string> SomeFiles() {
  Image linear(24, 18, 3);
  for (size_t i = 0; i < linear.pixels.size(); ++i) {
    linear.pixels[i] = static_cast<float>((i * 7919) % 101) / 100.0f;
  }
  return {MakePng(Pattern(24, 18, 3, 255), 8),
          MakePng(Pattern(24, 18, 3, 255), 8, PngLayout::kInterlaced),
          MakeJpeg(Gradient(24, 18, 3)),
          MakeJpeg(Gradient(24, 18, 3), JpegLayout::kProgressive),
          *EncodeExr(linear),
          *EncodeExr(linear, ExrDepth::kFloat),
          MakeRadiance(RgbePattern(24, 18), RadianceLayout::kPlain),
          MakeRadiance(RgbePattern(24, 18), RadianceLayout::kPixelRuns),
          MakeRadiance(RgbePattern(24, 18), RadianceLayout::kComponentRuns)};
}

TEST(ImageReaderTest, TruncationAtEveryLengthIsAnError) {
  for (const std::string& bytes : SomeFiles()) {
    ASSERT_TRUE(ReadToEnd(bytes).ok());
    for (size_t size = 0; size < bytes.size(); ++size) {
      const absl::Status status = ReadToEnd(bytes.substr(0, size));
      ASSERT_FALSE(status.ok()) << "cut to " << size << " of " << bytes.size();
      ASSERT_THAT(std::string(status.message()), HasSubstr("picture"));
    }
  }
}

TEST(ImageReaderTest, FlippedBitsNeverCrashAndPngFindsThemAll) {
  const std::vector<std::string> files = SomeFiles();
  for (size_t file = 0; file < files.size(); ++file) {
    for (size_t i = 0; i < files[file].size(); ++i) {
      std::string bytes = files[file];
      bytes[i] = static_cast<char>(bytes[i] ^ (1 << (i % 8)));
      const absl::Status status = ReadToEnd(bytes);
      // The first two are PNG, where every byte is under a checksum.
      ASSERT_TRUE(file >= 2 || !status.ok()) << "file " << file << " byte " << i;
    }
  }
}

TEST(ImageReaderTest, ReadingPastTheEndOrIntoTheWrongSizeIsRefused) {
  const auto reader = Open(MakePng(Pattern(4, 2, 3, 255), 8));
  ASSERT_TRUE(reader.ok());
  std::vector<std::byte> rows(3 * 12);
  EXPECT_EQ((*reader)->ReadRows(3, rows).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ((*reader)->ReadRows(2, rows).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE((*reader)->ReadRows(2, std::span(rows).first(24)).ok());
}

}  // namespace
}  // namespace tessera
