// Decoder::DecodeTexels against Decode, texel by texel, for every codec.
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "tests/btf/codec/synthetic_btf.h"

namespace tessera {
namespace {

// Float sums of up to 1,875 terms against double ones.
constexpr double kTolerance = 2e-5;

void ExpectTexelsAsOneByOne(const BtfelTable& table) {
  const auto decoder = MakeDecoder(table);
  ASSERT_TRUE(decoder.ok()) << decoder.status();
  std::vector<float> rgb(3 * table.size());
  Rng rng(3);
  double largest = 0.0;
  for (int turns = 0; turns < 4; ++turns) {
    // Up to and beyond the largest measured angle, and below the horizon.
    for (const double theta_deg : {0.0, 33.0, 74.0, 86.0, 91.0}) {
      const Eigen::Vector3d light = VectorFromDirection({RadFromDeg(theta_deg), 6.0 * rng.NextDouble()});
      const Eigen::Vector3d view = VectorFromDirection({1.5 * rng.NextDouble(), 6.0 * rng.NextDouble()});
      (*decoder)->DecodeTexels(table.codes, light, view, turns, rgb);
      for (size_t i = 0; i < table.size(); ++i) {
        const Eigen::Array3d expected = (*decoder)->Decode(table.btfel(i), light, view, turns);
        largest = std::max(largest, expected.maxCoeff());
        for (int channel = 0; channel < 3; ++channel) {
          EXPECT_NEAR(rgb[3 * i + channel], expected[channel], kTolerance)
              << "texel " << i << " channel " << channel << " light " << theta_deg << " turns " << turns;
        }
      }
    }
  }
  EXPECT_GT(largest, 0.1);
}

// Sizes whose runs of codes are shorter than, equal to and no multiple of what is summed at once.
TEST(DecodeTexelsTest, DecodesAsOneByOne) {
  const struct {
    std::string_view codec;
    EncodeParams params;
  } kCases[] = {
      {"dsh", {.kl = 25, .kv = 25}},
      {"dsh", {.kl = 9, .kv = 4}},
      {"dsh-cls", {.kl = 1, .kv = 1}},
      {"dsh-ls", {.kl = 4, .kv = 1}},
      {"dfmf", {.rank = 1}},
      {"dfmf", {.rank = 8}},
      {"dfmf", {.rank = 13}},
      {"dfmf", {.rank = 40}},
      {"view-pca", {.eigen_textures = 1}},
      {"view-pca", {.eigen_textures = 5}},
      {"view-pca", {.eigen_textures = 20}},
  };
  for (const auto& [codec, params] : kCases) {
    SampledBtf btf = ShinyBtf(9, 5, RingDirections(4, 9), RingDirections(4, 12));
    const auto material = FindCodec(codec)->Encode(btf, params, {});
    ASSERT_TRUE(material.ok()) << material.status();
    SCOPED_TRACE(std::string(codec) + ", " + std::to_string(material->btfels.num_coefficients));
    ExpectTexelsAsOneByOne(material->btfels);
  }
}

}  // namespace
}  // namespace tessera
