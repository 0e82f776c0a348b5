// Small tile sets of every codec, and how far two of them are apart.
#pragma once

#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <utility>

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

// Over all texels of the table and all measured directions, by another way than the plan's.
inline double RmseBetween(const TileSet& a, const TileSet& b) {
  const auto decoder_a = *MakeDecoder(a.btfels);
  const auto decoder_b = *MakeDecoder(b.btfels);
  double squares = 0.0;
  size_t count = 0;
  for (const Direction& view : a.btfels.views) {
    for (const Direction& light : a.btfels.lights) {
      for (size_t i = 0; i < a.tile_index.size(); i += 37) {
        const auto value = [&](const TileSet& set, const Decoder& decoder) {
          return decoder.Decode(set.btfels.btfel(BtfelOfTexel(set.tile_index[i])), VectorFromDirection(light),
                                VectorFromDirection(view), 0);
        };
        squares += (value(a, *decoder_a) - value(b, *decoder_b)).square().sum();
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
