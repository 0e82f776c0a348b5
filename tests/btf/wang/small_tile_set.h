// A tile set of random texels, small enough for every test.
#pragma once

#include "btf/base/rng.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/tile_set.h"

namespace tessera {

inline TileSet SmallTileSet(std::string_view arrangement_id, uint64_t seed = 1) {
  constexpr int kTileSize = 8;
  constexpr int kStripHeight = 4;
  constexpr int kNumBtfels = 50;
  constexpr int kLightFunctions = 4;
  constexpr int kCoefficients = 3 * kLightFunctions;
  const Arrangement& arrangement = **FindArrangement(arrangement_id);
  Rng rng(seed);
  TileSet tile_set;
  tile_set.arrangement_id = arrangement.id;
  tile_set.arrangement_sha256 = arrangement.sha256;
  tile_set.tile_size = kTileSize;
  tile_set.strip_height = kStripHeight;
  tile_set.tile_codes = arrangement.codes;
  for (size_t i = 0; i < arrangement.codes.size() * kTileSize * kTileSize; ++i) {
    tile_set.tile_index.push_back(
        PackTexel(static_cast<uint32_t>(rng.NextBelow(kNumBtfels)), static_cast<int>(rng.NextBelow(4))));
  }
  BtfelTable& table = tile_set.btfels;
  table.codec_id = "dsh-cls";
  table.codec_version = 1;
  table.num_coefficients = kCoefficients;
  table.parameters = {{"kl", kLightFunctions}, {"kv", 1}};
  CodecTable light{.shape = {kLightFunctions, kLightFunctions}, .values = {}};
  for (int i = 0; i < kLightFunctions * kLightFunctions; ++i) {
    light.values.push_back(i % (kLightFunctions + 1) == 0 ? 1.0f : 0.0f);
  }
  table.tables["basis_light"] = light;
  table.tables["basis_view"] = {.shape = {1, 1}, .values = {1.0f}};
  for (int i = 0; i < kCoefficients; ++i) {
    table.offset.push_back(-0.1f * static_cast<float>(i));
    table.step.push_back(0.01f);
  }
  for (int i = 0; i < kNumBtfels * kCoefficients; ++i) {
    table.codes.push_back(static_cast<uint8_t>(rng.NextBelow(256)));
  }
  table.views = {{0.0, 0.0}, {1.0, 2.0}};
  table.lights = {{0.0, 0.0}, {0.5, 1.0}, {1.2, 3.0}};
  tile_set.provenance = {"made by the test", "CC0", "nobody"};
  tile_set.radiometry = "reflectance";
  for (int i = 0; i < kNumBtfels; ++i) {
    tile_set.source_pixels.push_back(static_cast<uint32_t>(3 * i + 1));
  }
  tile_set.seam_heat.assign(tile_set.tile_index.size(), 0);
  tile_set.seam_heat[5] = 70;
  tile_set.certificate = {{"ratio", 1.05}};
  tile_set.metadata = {{"seed", 7}, {"exemplar", {{"width", 16}}}};
  tile_set.other_keys = {{"future_key", {1, 2}}};
  return tile_set;
}

}  // namespace tessera
