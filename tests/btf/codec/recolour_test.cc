#include "btf/codec/recolour.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/codec/decoder.h"
#include "btf/data/direction_sets.h"
#include "btf/math/conventions.h"
#include "tests/support/codecs.h"
#include "tests/support/noise_btf.h"

namespace tessera {
namespace {

using testing::HasSubstr;

constexpr int kSize = 8;

Material MakeMaterial(const std::string& codec) {
  NoiseBtf source(kSize, kSize, *DirectionSet("3x4"), *DirectionSet("3x4"));
  const auto material = Encode(codec, source, {.kl = 9, .kv = 4, .eigen_textures = 3});
  EXPECT_TRUE(material.ok()) << material.status();
  return *material;
}

// Unclamped value of a texel.
Eigen::Vector3d ValueOf(const Decoder& decoder, const Material& material, size_t texel,
                        const Direction& light, const Direction& view) {
  std::vector<double> coefficients(decoder.num_coefficients());
  decoder.Dequantize(material.btfels.btfel(texel), coefficients);
  return decoder.Evaluate(coefficients, VectorFromDirection(light), VectorFromDirection(view)).matrix();
}

TEST(HueSaturationMapTest, KeepsLuminanceAndGreysAndTurnsRedToGreen) {
  const Eigen::RowVector3d luminance(0.2126, 0.7152, 0.0722);
  for (const double hue : {-2.0, 0.3, 1.0, 3.0}) {
    for (const double saturation : {0.0, 0.6, 2.0}) {
      const Eigen::Matrix3d map = HueSaturationMap(hue, saturation);
      EXPECT_LT((luminance * map - luminance).norm(), 1e-12);
      EXPECT_LT((map * Eigen::Vector3d::Ones() - Eigen::Vector3d::Ones()).norm(), 1e-12);
    }
  }
  EXPECT_LT((HueSaturationMap(0.0, 1.0) - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  const Eigen::Vector3d grey = HueSaturationMap(1.0, 0.0) * Eigen::Vector3d(0.9, 0.2, 0.1);
  EXPECT_NEAR(grey.maxCoeff(), grey.minCoeff(), 1e-12);
  const Eigen::Vector3d green = HueSaturationMap(RadFromDeg(120.0), 1.0) * Eigen::Vector3d(0.5, 0.2, 0.2);
  EXPECT_NEAR(green[0], green[2], 1e-12);
  EXPECT_NEAR(green[1] - green[0], 0.3, 1e-12);
}

class RecolourTest : public testing::TestWithParam<std::string> {};

TEST_P(RecolourTest, DecodedValuesAreMappedAndTheOthersStay) {
  const Material before = MakeMaterial(GetParam());
  Material after = before;
  std::vector<uint8_t> map_of_texel(kSize * kSize, 0);
  std::fill(map_of_texel.begin() + 10, map_of_texel.begin() + 30, 1);
  std::fill(map_of_texel.begin() + 40, map_of_texel.begin() + 50, 2);
  const std::vector<Eigen::Matrix3d> maps = {HueSaturationMap(RadFromDeg(150.0), 1.2),
                                             HueSaturationMap(0.0, 0.0)};
  const absl::Status status = RecolourTexels(maps, map_of_texel, after);
  ASSERT_TRUE(status.ok()) << status;
  const auto decoder_before = MakeDecoder(before.btfels);
  const auto decoder_after = MakeDecoder(after.btfels);
  double error = 0.0;
  double moved = 0.0;
  double norm = 0.0;
  for (const Direction& light : before.btfels.lights) {
    for (const Direction& view : before.btfels.views) {
      for (size_t texel = 0; texel < map_of_texel.size(); ++texel) {
        const Eigen::Vector3d old = ValueOf(**decoder_before, before, texel, light, view);
        const int map = map_of_texel[texel];
        const Eigen::Vector3d wanted = map == 0 ? old : Eigen::Vector3d(maps[map - 1] * old);
        error += (ValueOf(**decoder_after, after, texel, light, view) - wanted).squaredNorm();
        moved += (wanted - old).squaredNorm();
        norm += old.squaredNorm();
      }
    }
  }
  EXPECT_GT(std::sqrt(moved / norm), 0.1) << "the test moves colours";
  EXPECT_LT(std::sqrt(error / norm), 0.02) << "rounding to 8 bits";
}

INSTANTIATE_TEST_SUITE_P(Linear, RecolourTest, testing::Values("dsh-cls", "dsh", "view-pca"), CodecTestName);

TEST(RecolourTexelsTest, TexelsWithoutAMapKeepTheirBytesWhereRangesHold) {
  const Material before = MakeMaterial("dsh-cls");
  Material after = before;
  std::vector<uint8_t> map_of_texel(kSize * kSize, 0);
  map_of_texel[7] = 1;
  // Towards the texel's own grey: the coefficients grow no larger than they are somewhere.
  const Eigen::Matrix3d map = HueSaturationMap(0.0, 0.999);
  ASSERT_TRUE(RecolourTexels({&map, 1}, map_of_texel, after).ok());
  for (size_t i = 0; i < before.btfels.offset.size(); ++i) {
    if (before.btfels.offset[i] != after.btfels.offset[i] || before.btfels.step[i] != after.btfels.step[i]) {
      continue;
    }
    for (size_t texel = 0; texel < map_of_texel.size(); ++texel) {
      if (texel != 7) {
        ASSERT_EQ(before.btfels.btfel(texel)[i], after.btfels.btfel(texel)[i]) << texel << " " << i;
      }
    }
  }
}

TEST(RecolourTexelsTest, RefusesWhatItCannotDo) {
  Material factored = MakeMaterial("dfmf");
  const Eigen::Matrix3d map = HueSaturationMap(1.0, 1.0);
  const std::vector<uint8_t> one(kSize * kSize, 1);
  const absl::Status status = RecolourTexels({&map, 1}, one, factored);
  EXPECT_EQ(status.code(), absl::StatusCode::kUnimplemented);
  EXPECT_THAT(std::string(status.message()), HasSubstr("codec \"dfmf\": its channels share coefficients"));

  Material material = MakeMaterial("dsh-cls");
  EXPECT_THAT(std::string(RecolourTexels({&map, 1}, std::vector<uint8_t>(5, 1), material).message()),
              HasSubstr("5 entries for 64 texels"));
  EXPECT_THAT(
      std::string(RecolourTexels({&map, 1}, std::vector<uint8_t>(kSize * kSize, 2), material).message()),
      HasSubstr("colour map 2 of 1"));
  const Eigen::Matrix3d broken = Eigen::Matrix3d::Constant(std::nan(""));
  EXPECT_THAT(std::string(RecolourTexels({&broken, 1}, one, material).message()), HasSubstr("not finite"));
}

}  // namespace
}  // namespace tessera
