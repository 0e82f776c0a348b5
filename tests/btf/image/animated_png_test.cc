#include "btf/image/animated_png.h"

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "btf/image/image_io.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

Image Ramp(int width, int height, float shift) {
  Image image(width, height, 4);
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    image.pixels[i] = static_cast<float>((i * 37 % 101) / 101.0 + shift) / 2.0f;
  }
  return image;
}

struct Chunk {
  std::string type;
  std::string data;
};

uint32_t Number(std::string_view bytes) {
  uint32_t value = 0;
  for (const char byte : bytes.substr(0, 4)) {
    value = value << 8 | static_cast<uint8_t>(byte);
  }
  return value;
}

std::vector<Chunk> Parse(std::string_view png) {
  std::vector<Chunk> chunks;
  for (size_t at = 8; at < png.size();) {
    const uint32_t length = Number(png.substr(at));
    const std::string_view checked = png.substr(at + 4, length + 4);
    EXPECT_EQ(Number(png.substr(at + 8 + length)),
              crc32(0, reinterpret_cast<const Bytef*>(checked.data()), static_cast<uInt>(checked.size())));
    chunks.push_back({std::string(checked.substr(0, 4)), std::string(checked.substr(4))});
    at += length + 12;
  }
  return chunks;
}

TEST(AnimatedPng, HoldsEveryFrameAsItWas) {
  // Several chunks of pixels a frame.
  std::vector<std::string> frames;
  for (int i = 0; i < 3; ++i) {
    frames.push_back(*EncodePng(Ramp(150, 90, 0.3f * static_cast<float>(i))));
  }
  const auto animation = AnimatedPng(frames, {.frames_per_second = 12, .loops = 2});
  ASSERT_TRUE(animation.ok()) << animation.status();
  EXPECT_EQ(*AnimatedPng(frames, {.frames_per_second = 12, .loops = 2}), *animation);
  const auto decode = [](std::string_view png) {
    return DecodeImage(std::as_bytes(std::span(png)), "frame", std::nullopt);
  };
  EXPECT_EQ(decode(*animation)->pixels, decode(frames[0])->pixels);

  const std::vector<Chunk> chunks = Parse(*animation);
  EXPECT_EQ(chunks.front().type, "IHDR");
  EXPECT_EQ(chunks[1].type, "acTL");
  EXPECT_EQ(Number(chunks[1].data), 3u);
  EXPECT_EQ(Number(chunks[1].data.substr(4)), 2u);
  EXPECT_EQ(chunks.back().type, "IEND");
  // The pixels of each frame, and the numbers of the chunks that have one.
  std::vector<std::string> pixels;
  uint32_t sequence = 0;
  for (const Chunk& chunk : chunks) {
    if (chunk.type == "fcTL") {
      pixels.emplace_back();
      ASSERT_EQ(chunk.data.size(), 26u);
      EXPECT_EQ(Number(chunk.data), sequence++);
      EXPECT_EQ(Number(chunk.data.substr(4)), 150u);
      EXPECT_EQ(Number(chunk.data.substr(8)), 90u);
      EXPECT_EQ(Number(chunk.data.substr(20)), 1u << 16 | 12u);
    } else if (chunk.type == "IDAT") {
      pixels.back() += chunk.data;
    } else if (chunk.type == "fdAT") {
      EXPECT_EQ(Number(chunk.data), sequence++);
      pixels.back() += chunk.data.substr(4);
    }
  }
  ASSERT_EQ(pixels.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    std::string expected;
    for (const Chunk& chunk : Parse(frames[i])) {
      expected += chunk.type == "IDAT" ? chunk.data : "";
    }
    EXPECT_EQ(pixels[i], expected) << i;
  }
}

TEST(AnimatedPng, RefusesFramesThatDoNotFit) {
  const std::string small = *EncodePng(Ramp(4, 4, 0.0f));
  const std::string large = *EncodePng(Ramp(4, 5, 0.0f));
  const auto message = [](std::vector<std::string> frames, AnimationParams params = {}) {
    const absl::Status status = AnimatedPng(frames, params).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    return std::string(status.message());
  };
  EXPECT_THAT(message({}), HasSubstr("0 frames"));
  EXPECT_THAT(message({small, large}), HasSubstr("frame 1"));
  EXPECT_THAT(message({small, "PNG"}), HasSubstr("not a PNG"));
  for (size_t size = 8; size + 4 < small.size(); ++size) {
    EXPECT_FALSE(AnimatedPng(std::vector{small.substr(0, size)}, {}).ok()) << size;
  }
  EXPECT_THAT(message({small}, {.frames_per_second = 0}), HasSubstr("0 frames a second"));
}

}  // namespace
}  // namespace tessera
