// Small tile sets of every codec, and how far two of them are apart.
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "btf/base/sha256.h"
#include "btf/codec/decoder.h"
#include "btf/wang/tile_set.h"
#include "btf/wang/tile_set_parts.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/btf/render/hand_made.h"
#include "tests/support/codecs.h"

namespace tessera {

// Directions of the plan are a choice among all; with so few texels their errors differ by less than this.
inline constexpr double kMostErrorRatio = 1.6;
// Stored directions are float32.
inline constexpr double kDirectionRounding = 1e-6;
// Of values of layers, which are rounded anew.
inline constexpr double k8BitRmse = 0.003;

inline TileSet TileSetOf(const std::string& codec, int tile_size) {
  SampledBtf btf = ShinyBtf(6, 6, RingDirections(3, 6), RingDirections(3, 7));
  auto material =
      Encode(codec, btf, {.kl = 16, .kv = 9, .eigen_textures = 3, .rank = codec == "dfmf" ? 16 : 0});
  EXPECT_TRUE(material.ok()) << material.status();
  return testing::RandomTileSet(std::move(material->btfels), tile_size, 5);
}

// Of patches, as tiles are: each quarter of a tile shows a square of an exemplar of 12x12 texels, turned.
inline TileSet PatchTileSetOf(const std::string& codec, int tile_size) {
  constexpr int kWidth = 12;
  SampledBtf btf = ShinyBtf(kWidth, kWidth, RingDirections(3, 6), RingDirections(3, 7));
  auto material =
      Encode(codec, btf, {.kl = 16, .kv = 9, .eigen_textures = 3, .rank = codec == "dfmf" ? 16 : 0});
  EXPECT_TRUE(material.ok()) << material.status();
  TileSet tile_set = testing::RandomTileSet(std::move(material->btfels), tile_size, 5);
  tile_set.metadata["exemplar"] = {{"width", kWidth}};
  for (uint32_t pixel = 0; pixel < kWidth * kWidth; ++pixel) {
    tile_set.source_pixels.push_back(pixel);
  }
  Rng rng(6);
  const int half = tile_size / 2;
  for (size_t tile = 0; tile < tile_set.tile_codes.size(); ++tile) {
    for (int quarter = 0; quarter < 4; ++quarter) {
      const auto left = static_cast<int>(rng.NextBelow(kWidth - half + 1));
      const auto top = static_cast<int>(rng.NextBelow(kWidth - half + 1));
      const auto turns = static_cast<int>(rng.NextBelow(4));
      for (int i = 0; i < half * half; ++i) {
        const int x = i % half;
        const int y = i / half;
        const int last = half - 1;
        const std::array<std::pair<int, int>, 4> turned = {
            {{x, y}, {last - y, x}, {last - x, last - y}, {y, last - x}}};
        const auto [source_x, source_y] = turned[static_cast<size_t>(turns)];
        const size_t at = (tile * tile_size + quarter / 2 * half + y) * tile_size + quarter % 2 * half + x;
        tile_set.tile_index[at] =
            PackTexel(static_cast<uint32_t>((top + source_y) * kWidth + left + source_x), turns);
      }
    }
  }
  return tile_set;
}

// Over texels spread over the tiles and all measured directions, by another way than the plan's: of means of
// squares of side x side texels, each in its own frame.
inline double RmseBetween(const TileSet& a, const TileSet& b, int side = 1) {
  const auto decoder_a = *MakeDecoder(a.btfels);
  const auto decoder_b = *MakeDecoder(b.btfels);
  double squares = 0.0;
  size_t count = 0;
  for (const Direction& view : a.btfels.views) {
    for (const Direction& light : a.btfels.lights) {
      const LinearForm form_a = decoder_a->Form(VectorFromDirection(light), VectorFromDirection(view));
      const LinearForm form_b = decoder_b->Form(VectorFromDirection(light), VectorFromDirection(view));
      const int across = a.tile_size / side;
      const size_t squares_in_all = a.tile_codes.size() * across * across;
      for (size_t i = 0; i < squares_in_all; i += 37) {
        const auto value = [&](const TileSet& set, const LinearForm& form) {
          Eigen::Array3d sum = Eigen::Array3d::Zero();
          for (int j = 0; j < side * side; ++j) {
            const int tile = static_cast<int>(i) / (across * across);
            const int x = static_cast<int>(i) % across * side + j % side;
            const int y = static_cast<int>(i) / across % across * side + j / side;
            std::vector<double> values;
            const auto codes = set.btfels.btfel(BtfelOfTexel(set.texel(tile, x, y)));
            for (size_t c = 0; c < codes.size(); ++c) {
              values.push_back(set.btfels.offset[c] + static_cast<double>(set.btfels.step[c]) * codes[c]);
            }
            sum += form.ValueOf(values);
          }
          return (sum / (side * side)).max(0.0).eval();
        };
        squares += (value(a, form_a) - value(b, form_b)).square().sum();
        count += 3;
      }
    }
  }
  return std::sqrt(squares / static_cast<double>(count));
}

// The sets that the parts of a cut make, one after the other.
inline void ForPrefixes(const TileSet& tile_set, const TileSetCut& cut,
                        const std::function<void(size_t part, TileSetAssembler& assembler)>& body) {
  const auto cutter = TileSetCutter::Create(tile_set, cut);
  ASSERT_TRUE(cutter.ok()) << cutter.status();
  const std::string first = cutter->Part(0, "").value();
  auto assembler = TileSetAssembler::Begin(std::as_bytes(std::span(first)));
  ASSERT_TRUE(assembler.ok()) << assembler.status();
  for (size_t i = 0; i < cutter->num_parts(); ++i) {
    if (i > 0) {
      const std::string part = cutter->Part(i, Sha256Hex(std::as_bytes(std::span(first)))).value();
      const absl::Status added = assembler->Add(std::as_bytes(std::span(part)));
      ASSERT_TRUE(added.ok()) << added;
    }
    EXPECT_EQ(assembler->num_coefficients(), cutter->num_coefficients(i));
    EXPECT_EQ(assembler->is_complete(), i + 1 == cutter->num_parts());
    body(i, *assembler);
  }
}

}  // namespace tessera
