#include "btf/render/composite.h"

#include <span>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/image/image_io.h"

namespace tessera {
namespace {

TEST(CompositeOver, BlendsByCoverage) {
  Image picture(2, 1, 4);
  const std::vector<float> pixels = {1.0f, 0.5f, 0.0f, 0.25f, 9.0f, 9.0f, 9.0f, 0.0f};
  picture.pixels = pixels;
  const Background grey{{0.2f, 0.2f, 0.2f}, {0.2f, 0.2f, 0.2f}};
  const auto result = CompositeOver(picture, grey);
  ASSERT_TRUE(result.ok());
  EXPECT_FLOAT_EQ(result->at(0, 0)[0], 0.25f + 0.75f * 0.2f);
  EXPECT_FLOAT_EQ(result->at(1, 0)[2], 0.2f);
  EXPECT_EQ(CompositeOver(*result, grey).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ParseBackground, ReadsSrgbAsTheEncoderWritesIt) {
  const auto background = ParseBackground("#1080fF");
  ASSERT_TRUE(background.ok()) << background.status();
  const auto flat = CompositeOver(Image(1, 1, 4), *background);
  ASSERT_TRUE(flat.ok());
  const auto png = EncodePng(*flat);
  const auto back = DecodeImage(std::as_bytes(std::span(*png)), "png", Transfer::Linear());
  ASSERT_TRUE(back.ok());
  EXPECT_EQ(back->pixels, (std::vector<float>{16.0f / 255.0f, 128.0f / 255.0f, 1.0f}));
  for (const char* text : {"", "#", "fff", "1080fg", "1080ff0", "-1080f", "##1080f"}) {
    EXPECT_THAT(std::string(ParseBackground(text).status().message()),
                ::testing::HasSubstr("six hexadecimal"))
        << text;
  }
}

}  // namespace
}  // namespace tessera
