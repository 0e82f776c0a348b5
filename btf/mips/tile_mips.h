// Mip levels of a tile set: level l has tiles of w / 2^l texels, each the mean of 2 x 2 texels of the level
// below in reflectance, before the clamp at 0.
//
// Decoding is linear in a BTFel's coefficients, so a mean of BTFels of one turn is a BTFel. Where turning is
// a signed permutation of coefficients (Codec::Turns) BTFels are turned before they are averaged, and a texel
// has one part; its turn makes blocks that differ by turns alone share a BTFel. Elsewhere a texel has a part
// for each turn in the tile set: the mean of the texels below of that turn, and their share. Means are taken
// of unquantised means.
//
//   TESSERA_ASSIGN_OR_RETURN(TileMips mips, MakeTileMips(tile_set, {}, context));
//   for (const MipPart& part : mips.levels[0].texel(mips.parts_per_texel, tile, x, y)) {
//     value += part.weight * decoder.Evaluate(.., turned by TurnsOfTexel(part.texel));
//   }
//
// Source: L. Williams, Pyramidal parametrics, SIGGRAPH 1983.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/btfel_table.h"
#include "btf/wang/tile_set.h"

namespace tessera {

// What the texels below of one turn add to a texel: weight times the value of the BTFel `texel` names in its
// level, with its turns (PackTexel). The weights of a texel's parts sum to 1; 0: no such texels.
struct MipPart {
  uint32_t texel = 0;
  float weight = 0.0F;
};

struct MipLevel {
  int tile_size = 0;           // w / 2^l
  std::vector<MipPart> parts;  // [tiles][tile_size][tile_size][parts_per_texel], row 0 on top
  // With the tile set's codec and tables, no two alike. Offset and step are the level's own where texels have
  // one part, else those of the tile set, whose range means never leave.
  BtfelTable btfels;
  // Of the quantised level against exact means: RGB, clamped at 0, in linear reflectance, over at most
  // kMipErrorTexels texels spread over the tiles, each under kMipErrorPairs pairs of measured light and view.
  double quantisation_rmse = 0.0;

  [[nodiscard]] std::span<const MipPart> texel(int parts_per_texel, int tile, int x, int y) const {
    const size_t index = (static_cast<size_t>(tile) * tile_size + y) * tile_size + x;
    return std::span(parts).subspan(index * parts_per_texel, parts_per_texel);
  }
  // Of codes and parts.
  [[nodiscard]] uint64_t size_bytes() const { return btfels.codes.size() + parts.size() * sizeof(MipPart); }
};
inline constexpr int kMostMipLevels = 12;  // of tiles 4096 texels wide
inline constexpr int kMipErrorTexels = 4096;
inline constexpr int kMipErrorPairs = 8;

struct TileMips {
  int parts_per_texel = 1;       // 1..4, the same at all levels
  std::vector<MipLevel> levels;  // level 1 first; down to 1 x 1 texels, or to an odd tile size

  [[nodiscard]] uint64_t size_bytes() const;
};

struct MipParams {
  uint64_t max_bytes = uint64_t{1} << 30;  // of all levels together
};

// The same for any number of threads. Cost: every texel of the tile set is dequantised twice, 2 10^9
// coefficients for 96 tiles of 64 x 64 texels with 1,875; memory besides the result: for each thread the sums
// of a tile, codes of 16 tiles. Progress in stage "mips", tiles. Errors: INVALID_ARGUMENT naming a tile size
// that is odd or too large, or the texel or table that does not exist or is misshapen; UNIMPLEMENTED naming
// an unknown codec; RESOURCE_EXHAUSTED naming max_bytes where more are needed; CANCELLED.
[[nodiscard]] absl::StatusOr<TileMips> MakeTileMips(const TileSet& tile_set, const MipParams& params,
                                                    const RunContext& context);

}  // namespace tessera
