#include "btf/image/jpeg_writer.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "btf/image/image_io.h"

namespace tessera {
namespace {

std::vector<uint8_t> SmoothCodes(int width, int height) {
  std::vector<uint8_t> codes;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      codes.push_back(static_cast<uint8_t>(40 + 3 * x));
      codes.push_back(static_cast<uint8_t>(60 + 2 * y));
      codes.push_back(static_cast<uint8_t>(128 + 60 * std::sin(0.2 * (x + y))));
    }
  }
  return codes;
}

double RmsCodeError(const std::vector<uint8_t>& codes, const std::string& jpeg, int width, int height) {
  const absl::StatusOr<Image> image = DecodeImage(std::as_bytes(std::span(jpeg)), "test", Transfer::Linear());
  EXPECT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->width, width);
  EXPECT_EQ(image->height, height);
  double sum = 0.0;
  for (size_t i = 0; i < codes.size(); ++i) {
    const double difference = image->pixels[i] * 255.0 - codes[i];
    sum += difference * difference;
  }
  return std::sqrt(sum / static_cast<double>(codes.size()));
}

TEST(JpegWriterTest, QualityBuysAccuracyWithBytes) {
  const std::vector<uint8_t> codes = SmoothCodes(40, 24);
  const auto fine = EncodeJpeg(codes, 40, 24, 95);
  const auto coarse = EncodeJpeg(codes, 40, 24, 5);
  ASSERT_TRUE(fine.ok() && coarse.ok()) << fine.status() << coarse.status();
  EXPECT_LT(coarse->size(), fine->size());
  const double fine_error = RmsCodeError(codes, *fine, 40, 24);
  EXPECT_LT(fine_error, 2.0);
  EXPECT_GT(RmsCodeError(codes, *coarse, 40, 24), 2.0 * fine_error);
}

TEST(JpegWriterTest, RefusesWhatIsNoPicture) {
  const std::vector<uint8_t> codes(12);
  EXPECT_EQ(EncodeJpeg(codes, 2, 3, 75).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(EncodeJpeg(codes, 2, 2, 0).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(EncodeJpeg({}, 0, 0, 75).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera
