// What the two halves of tile_set_parts share. Private to tile_set_*.cc.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/status_macros.h"
#include "btf/codec/container.h"

namespace tessera {

inline constexpr char kTileSetPartKind[] = "tile_set_part";
// Header `labels`: what the texels of `tile_index` name, pixels of the exemplar or BTFels of the whole set.
inline constexpr char kPixelLabels[] = "source_pixels";
inline constexpr char kBtfelLabels[] = "btfels";
// What PackTexel can hold.
inline constexpr uint32_t kLargestLabel = (uint32_t{1} << 30) - 1;

inline Section Compressed(Section section) {
  section.encoding = Encoding::kZstd;
  return section;
}

// A section with one extent. Errors: RequireSection's.
template <typename T>
absl::StatusOr<std::vector<T>> ReadVector(const Container& container, std::string_view name) {
  TESSERA_ASSIGN_OR_RETURN(const Section* section,
                           RequireSection(container, name, DTypeOf<T>::value, std::array<int64_t, 1>{-1}));
  return SectionValues<T>(*section);
}

// body(tile) for the tiles named, or for all.
inline void ForTiles(const std::vector<uint32_t>& tiles, size_t num_tiles,
                     const std::function<void(size_t tile)>& body) {
  if (tiles.empty()) {
    for (size_t tile = 0; tile < num_tiles; ++tile) {
      body(tile);
    }
  }
  for (const uint32_t tile : tiles) {
    body(tile);
  }
}

// In patches the source pixel, turned or not, is linear in x and y: what is left after the prediction by
// three neighbours is 0 there. Sums are modulo 2^32; beyond the tile's sides lie zeros.
inline uint32_t PredictedTexel(int tile_size, std::span<const uint32_t> texels, int x, int y) {
  const auto at = [&](int column, int row) {
    return column < 0 || row < 0 ? 0U : texels[static_cast<size_t>(row) * tile_size + column];
  };
  return at(x - 1, y) + at(x, y - 1) - at(x - 1, y - 1);
}

// Texels of one tile become what is left of them, and back.
inline void PredictTexels(int tile_size, std::span<uint32_t> texels) {
  for (int y = tile_size - 1; y >= 0; --y) {
    for (int x = tile_size - 1; x >= 0; --x) {
      texels[static_cast<size_t>(y) * tile_size + x] -= PredictedTexel(tile_size, texels, x, y);
    }
  }
}
inline void RestoreTexels(int tile_size, std::span<uint32_t> texels) {
  for (int y = 0; y < tile_size; ++y) {
    for (int x = 0; x < tile_size; ++x) {
      texels[static_cast<size_t>(y) * tile_size + x] += PredictedTexel(tile_size, texels, x, y);
    }
  }
}

}  // namespace tessera
