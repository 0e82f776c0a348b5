#include "btf/mips/tile_mips.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/codec/decoder.h"
#include "btf/codec/quantize.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/hand_made.h"
#include "tests/support/codecs.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;
using testing::RandomBtfels;
using testing::RandomTileSet;
using testing::WhiteDiffuser;

// Sums of a few thousand floats, relative to a value of about 1.
constexpr double kRounding = 1e-5;

TileMips MipsOf(const TileSet& tile_set, int threads = 2) {
  RunContext context;
  context.num_threads = threads;
  auto mips = MakeTileMips(tile_set, {}, context);
  EXPECT_TRUE(mips.ok()) << mips.status();
  return mips.ok() ? *std::move(mips) : TileMips{};
}

// Under `light` and `view` in the frame of the tile, before the clamp.
class Values {
 public:
  Values(const Decoder& decoder, Eigen::Vector3d light, Eigen::Vector3d view) : decoder_(decoder) {
    for (int t = 0; t < 4; ++t) {
      forms_.push_back(decoder.Form(UnturnedFromTurned(light, t), UnturnedFromTurned(view, t)));
    }
  }

  [[nodiscard]] Eigen::Array3d Of(const BtfelTable& table, uint32_t texel) const {
    std::vector<double> values(table.num_coefficients);
    const auto codes = table.btfel(BtfelOfTexel(texel));
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = table.offset[i] + static_cast<double>(table.step[i]) * codes[i];
    }
    return forms_[TurnsOfTexel(texel)].ValueOf(values);
  }

  // How far half a step in every coefficient can move a value of the given turns, worst channel.
  [[nodiscard]] double QuantisationBound(const BtfelTable& table, int turns) const {
    Eigen::Array3d bound = Eigen::Array3d::Zero();
    const LinearForm& form = forms_[turns];
    const double* weight = form.weights.data();
    for (const LinearForm::Run& run : form.runs) {
      for (int i = run.first; i < run.first + run.count; ++i) {
        bound[run.channel] += std::abs(*weight++) * table.step[i] * (0.5 + kQuantizeRounding);
      }
    }
    return bound.maxCoeff();
  }

 private:
  const Decoder& decoder_;
  std::vector<LinearForm> forms_;
};

Eigen::Array3d ValueOf(const Values& values, const MipLevel& level, std::span<const MipPart> parts) {
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  for (const MipPart& part : parts) {
    if (part.weight > 0.0F) {
      sum += part.weight * values.Of(level.btfels, part.texel);
    }
  }
  return sum;
}

// Every texel of every level against the mean of the tile set's own texels below it. Largest error by bound.
double ExpectMeans(const TileSet& tile_set, const TileMips& mips) {
  const auto decoder = MakeDecoder(tile_set.btfels);
  EXPECT_TRUE(decoder.ok()) << decoder.status();
  const Values values(**decoder, VectorFromDirection({0.5, 1.1}), VectorFromDirection({0.8, 3.3}));
  double worst = 0.0;
  for (size_t l = 0; l < mips.levels.size(); ++l) {
    const MipLevel& level = mips.levels[l];
    const int block = tile_set.tile_size / level.tile_size;
    for (int tile = 0; std::cmp_less(tile, tile_set.tile_codes.size()); tile += 7) {
      for (int y = 0; y < level.tile_size; ++y) {
        for (int x = 0; x < level.tile_size; ++x) {
          Eigen::Array3d mean = Eigen::Array3d::Zero();
          for (int i = 0; i < block * block; ++i) {
            mean += values.Of(tile_set.btfels,
                              tile_set.texel(tile, x * block + i % block, y * block + i / block));
          }
          mean /= block * block;
          const auto parts = level.texel(mips.parts_per_texel, tile, x, y);
          double bound = kRounding;
          for (const MipPart& part : parts) {
            bound += part.weight * values.QuantisationBound(level.btfels, TurnsOfTexel(part.texel));
          }
          const double error = (ValueOf(values, level, parts) - mean).abs().maxCoeff();
          EXPECT_LE(error, bound) << "level " << l + 1 << ", tile " << tile << ", " << x << ", " << y;
          worst = std::max(worst, error / bound);
        }
      }
    }
  }
  return worst;
}

class CodecMipsTest : public ::testing::TestWithParam<std::string> {};

TEST_P(CodecMipsTest, ATexelIsTheMeanOfTheTurnedTexelsBelow) {
  SampledBtf btf = ShinyBtf(8, 6, RingDirections(4, 9), RingDirections(4, 12, 60.0));
  const auto material = Encode(GetParam(), btf, {.kl = 9, .kv = 4, .eigen_textures = 2, .rank = 12});
  ASSERT_TRUE(material.ok()) << material.status();
  const TileSet tile_set = RandomTileSet(material->btfels, 8, 5);
  const TileMips mips = MipsOf(tile_set);
  ASSERT_EQ(mips.levels.size(), 3U);
  EXPECT_EQ(mips.levels[2].tile_size, 1);
  EXPECT_EQ(mips.parts_per_texel, GetParam().starts_with("dsh") ? 1 : 4);
  // Not so small that nothing was quantised.
  EXPECT_GT(ExpectMeans(tile_set, mips), 0.01);
  for (const MipLevel& level : mips.levels) {
    EXPECT_GT(level.quantisation_rmse, 0.0);
    EXPECT_LT(level.quantisation_rmse, 0.01);
  }
}

INSTANTIATE_TEST_SUITE_P(AllCodecs, CodecMipsTest, ::testing::ValuesIn(AllCodecs()), CodecTestName);

TEST(TileMipsTest, LevelsOfAConstantMaterialAreConstant) {
  for (const BtfelTable& table : {WhiteDiffuser(), RandomBtfels(1, 9, 9, 4)}) {
    TileSet tile_set = RandomTileSet(table, 8, 3);
    if (table.num_coefficients > 12) {
      std::ranges::fill(tile_set.tile_index, 0U);  // it has a direction of its own
    }
    const TileMips mips = MipsOf(tile_set);
    ASSERT_EQ(mips.levels.size(), 3U);
    const auto decoder = MakeDecoder(table);
    ASSERT_TRUE(decoder.ok());
    const Values values(**decoder, VectorFromDirection({0.3, 1.0}), VectorFromDirection({0.6, 2.0}));
    const Eigen::Array3d expected = values.Of(table, 0);
    for (const MipLevel& level : mips.levels) {
      EXPECT_EQ(level.btfels.size(), 1U);
      EXPECT_LT((values.Of(level.btfels, 0) - expected).abs().maxCoeff(), kRounding);
      EXPECT_LT(level.quantisation_rmse, kRounding);
    }
  }
}

TEST(TileMipsTest, FourTurnsInOneBlockStayApartWhereCoefficientsCannotBeTurned) {
  SampledBtf btf = ShinyBtf(8, 6, RingDirections(4, 9), RingDirections(4, 12, 60.0));
  const auto material = Encode("dfmf", btf, {.rank = 12});
  ASSERT_TRUE(material.ok()) << material.status();
  TileSet tile_set = RandomTileSet(material->btfels, 2, 5);
  for (int turns = 0; turns < 4; ++turns) {
    tile_set.tile_index[turns] = PackTexel(3 * turns, turns);
  }
  const TileMips mips = MipsOf(tile_set);
  ASSERT_EQ(mips.levels.size(), 1U);
  ASSERT_EQ(mips.parts_per_texel, 4);
  for (int turns = 0; turns < 4; ++turns) {
    const MipPart& part = mips.levels[0].parts[turns];
    EXPECT_EQ(TurnsOfTexel(part.texel), turns);
    EXPECT_EQ(part.weight, 0.25F);
    // A single BTFel comes through as it is.
    const auto codes = mips.levels[0].btfels.btfel(BtfelOfTexel(part.texel));
    EXPECT_TRUE(std::ranges::equal(codes, tile_set.btfels.btfel(3 * turns)));
  }
  ExpectMeans(tile_set, mips);
}

TEST(TileMipsTest, BasesThatDoNotTurnKeepPartsToo) {
  const TileSet tile_set = RandomTileSet(RandomBtfels(20, 9, 4, 2, testing::BasisKind::kGeneral), 4, 5);
  const TileMips mips = MipsOf(tile_set);
  EXPECT_EQ(mips.parts_per_texel, 4);
  ExpectMeans(tile_set, mips);
  EXPECT_EQ(MipsOf(RandomTileSet(RandomBtfels(20, 9, 4, 2, testing::BasisKind::kOrthonormal), 4, 5))
                .parts_per_texel,
            1);
}

TEST(TileMipsTest, WithoutTurnsATexelHasOnePart) {
  SampledBtf btf = ShinyBtf(8, 6, RingDirections(4, 9), RingDirections(4, 12, 60.0));
  const auto material = Encode("dfmf", btf, {.rank = 12});
  ASSERT_TRUE(material.ok()) << material.status();
  TileSet tile_set = RandomTileSet(material->btfels, 12, 5);
  for (uint32_t& texel : tile_set.tile_index) {
    texel = BtfelOfTexel(texel);
  }
  const TileMips mips = MipsOf(tile_set);
  EXPECT_EQ(mips.parts_per_texel, 1);
  // 12 is even twice.
  ASSERT_EQ(mips.levels.size(), 2U);
  EXPECT_EQ(mips.levels[1].tile_size, 3);
  ExpectMeans(tile_set, mips);
}

TEST(TileMipsTest, TexelsThatDifferByTurnsAloneShareABtfel) {
  constexpr int kSize = 8;
  TileSet tile_set = RandomTileSet(RandomBtfels(50, 9, 9, 4), kSize, 3);
  // Each tile is the one before it, turned.
  for (size_t i = kSize * kSize; i < tile_set.tile_index.size(); ++i) {
    const size_t tile = i / (kSize * kSize);
    const size_t x = i % kSize;
    const size_t y = i / kSize % kSize;
    const uint32_t before = tile_set.tile_index[((tile - 1) * kSize + x) * kSize + kSize - 1 - y];
    tile_set.tile_index[i] = PackTexel(BtfelOfTexel(before), TurnsOfTexel(before) + 1);
  }
  const TileMips mips = MipsOf(tile_set);
  // 16 blocks, in four turns each; sums in another order may round to another code, so some are kept twice.
  EXPECT_LE(mips.levels[0].btfels.size(), 40U);
  EXPECT_LE(mips.levels[1].btfels.size(), 8U);
  ExpectMeans(tile_set, mips);
}

TEST(TileMipsTest, TheReportedErrorIsWhatQuantisationDoes) {
  // Few enough texels for all of them to be measured.
  const TileSet tile_set = RandomTileSet(RandomBtfels(50, 9, 9, 4), 4, 3);
  const TileMips mips = MipsOf(tile_set);
  const auto decoder = MakeDecoder(tile_set.btfels);
  ASSERT_TRUE(decoder.ok());
  // The two measured directions of this table: views and lights at the normal and at their largest angles.
  double squares = 0.0;
  for (int pair = 0; pair < kMipErrorPairs; ++pair) {
    const size_t at = 2 * pair + 1;
    const Values values(**decoder, VectorFromDirection(tile_set.btfels.lights[at * 5 % 16 / 8]),
                        VectorFromDirection(tile_set.btfels.views[at / 8]));
    for (int i = 0; i < 96 * 4; ++i) {
      Eigen::Array3d mean = Eigen::Array3d::Zero();
      for (int j = 0; j < 4; ++j) {
        mean += 0.25 *
                values.Of(tile_set.btfels, tile_set.texel(i / 4, i % 2 * 2 + j % 2, i / 2 % 2 * 2 + j / 2));
      }
      const Eigen::Array3d coded =
          ValueOf(values, mips.levels[0], mips.levels[0].texel(1, i / 4, i % 2, i / 2 % 2));
      squares += (mean.max(0.0) - coded.max(0.0)).square().sum();
    }
  }
  const double rmse = std::sqrt(squares / (96 * 4 * kMipErrorPairs * 3));
  EXPECT_NEAR(mips.levels[0].quantisation_rmse, rmse, 0.02 * rmse);
}

TEST(TileMipsTest, TheSameForAnyNumberOfThreads) {
  SampledBtf btf = ShinyBtf(8, 6, RingDirections(4, 9), RingDirections(4, 12, 60.0));
  const auto dfmf = Encode("dfmf", btf, {.rank = 12});
  ASSERT_TRUE(dfmf.ok());
  for (const BtfelTable& table : {RandomBtfels(50, 9, 9, 4), dfmf->btfels}) {
    const TileSet tile_set = RandomTileSet(table, 8, 3);
    const TileMips one = MipsOf(tile_set, 1);
    const TileMips four = MipsOf(tile_set, 4);
    ASSERT_EQ(one.levels.size(), four.levels.size());
    for (size_t l = 0; l < one.levels.size(); ++l) {
      EXPECT_TRUE(one.levels[l].btfels.codes == four.levels[l].btfels.codes);
      EXPECT_EQ(one.levels[l].btfels.offset, four.levels[l].btfels.offset);
      EXPECT_EQ(one.levels[l].quantisation_rmse, four.levels[l].quantisation_rmse);
      EXPECT_TRUE(std::ranges::equal(
          one.levels[l].parts, four.levels[l].parts,
          [](const MipPart& a, const MipPart& b) { return a.texel == b.texel && a.weight == b.weight; }));
    }
  }
}

TEST(TileMipsTest, RefusesByName) {
  const TileSet good = RandomTileSet(RandomBtfels(50, 4, 4, 4), 8, 3);
  const auto expect = [](const TileSet& tile_set, const MipParams& params, absl::StatusCode code,
                         const char* word) {
    const absl::Status status = MakeTileMips(tile_set, params, {}).status();
    EXPECT_EQ(status.code(), code) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(word));
  };
  const auto invalid = absl::StatusCode::kInvalidArgument;
  expect(RandomTileSet(RandomBtfels(50, 4, 4, 4), 7, 3), {}, invalid, "7x7");
  TileSet tile_set = good;
  tile_set.btfels.codec_id = "dfmf-x";
  expect(tile_set, {}, absl::StatusCode::kUnimplemented, "dfmf-x");
  tile_set = good;
  tile_set.tile_index[5] = 50;
  expect(tile_set, {}, invalid, "texel 5");
  tile_set = good;
  tile_set.tile_index.pop_back();
  expect(tile_set, {}, invalid, "96 tiles");
  tile_set = good;
  tile_set.btfels.step.pop_back();
  expect(tile_set, {}, invalid, "47 steps");
  expect(good, {.max_bytes = 1000}, absl::StatusCode::kResourceExhausted, "at most 1000");
  RunContext stopped;
  std::stop_source stop;
  stop.request_stop();
  stopped.stop = stop.get_token();
  EXPECT_EQ(MakeTileMips(good, {}, stopped).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
