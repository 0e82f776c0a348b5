#include "client/lib/flat_decode.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

// 3 x 2 texels of a codec that knows only constants: one coefficient a channel, reflectance code / 100.
Material ConstantMaterial() {
  Material material;
  material.width = 3;
  material.height = 2;
  BtfelTable& table = material.btfels;
  table.codec_id = "dsh-cls";
  table.codec_version = 1;
  table.num_coefficients = 3;
  table.offset = {0, 0, 0};
  // y_0 is 1 / sqrt(4 pi), once for the light and once for the view.
  table.step = std::vector<float>(3, static_cast<float>(4.0 * kPi / 100.0));
  table.tables["basis_light"] = {{1, 1}, {1.0F}};
  table.tables["basis_view"] = {{1, 1}, {1.0F}};
  table.parameters = {{"kl", 1}, {"kv", 1}};
  table.views = {{0.0, 0.0}, {1.2, 0.0}};
  table.lights = table.views;
  for (int i = 0; i < 3 * 2 * 3; ++i) {
    table.codes.push_back(static_cast<uint8_t>(10 * i));
  }
  return material;
}

TEST(FlatDecodeTest, PutsEveryTexelInItsPlace) {
  const Material material = ConstantMaterial();
  const auto picture = DecodeFlat(material, {0.3, 1.0}, {0.5, 2.0});
  ASSERT_TRUE(picture.ok()) << picture.status();
  ASSERT_EQ(picture->width, 3);
  ASSERT_EQ(picture->height, 2);
  ASSERT_EQ(picture->channels, 3);
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        EXPECT_NEAR(picture->at(x, y)[channel], 0.1 * ((y * 3 + x) * 3 + channel), 1e-6);
      }
    }
  }
}

TEST(FlatDecodeTest, RefusesAMaterialWithTooFewTexels) {
  Material material = ConstantMaterial();
  material.height = 3;
  EXPECT_TRUE(absl::IsInvalidArgument(DecodeFlat(material, {}, {}).status()));
}

TEST(FlatDecodeTest, Stops) {
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(absl::IsCancelled(DecodeFlat(ConstantMaterial(), {}, {}, {.stop = stop.get_token()}).status()));
}

}  // namespace
}  // namespace tessera
