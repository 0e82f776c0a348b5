// A tile set: the tiles of one material in one arrangement, as index maps into a table of the referenced
// BTFels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/codec/btfel_table.h"

namespace tessera {

// One entry of `tile_index`: the low 30 bits name the BTFel, the top 2 its quarter turns, counter-clockwise.
constexpr uint32_t PackTexel(uint32_t btfel, int turns) {
  return btfel | (static_cast<uint32_t>(turns & 3) << 30);
}
inline constexpr uint32_t kLargestPackedBtfel = (uint32_t{1} << 30) - 1;
constexpr uint32_t BtfelOfTexel(uint32_t texel) {
  return texel & kLargestPackedBtfel;
}
constexpr int TurnsOfTexel(uint32_t texel) {
  return static_cast<int>(texel >> 30);
}

struct TileSet {
  std::string arrangement_id;
  std::string arrangement_sha256;
  int tile_size = 0;                 // w, texels
  int strip_height = 0;              // h, texels
  std::vector<uint32_t> tile_codes;  // ascending, the arrangement's
  std::vector<uint32_t> tile_index;  // [tiles][w][w], row 0 on top; see PackTexel
  BtfelTable btfels;                 // only the referenced BTFels
  // Where each BTFel lies in the exemplar, [BTFels], y * width + x, ascending; empty where unknown.
  std::vector<uint32_t> source_pixels;
  // How visible the seams at each texel are, [tiles][w][w]: 0 no seam, 64 as the material's own steps
  // (tiles/certificate.h); empty where unknown.
  std::vector<uint8_t> seam_heat;
  Provenance provenance;
  std::string radiometry;
  nlohmann::json certificate = nlohmann::json::object();  // measured seam quality
  // Seed, parameters, thresholds reached, anisotropy, captured share.
  nlohmann::json metadata = nlohmann::json::object();
  // Header keys that this version does not know; written back as they were.
  nlohmann::json other_keys = nlohmann::json::object();

  [[nodiscard]] uint32_t texel(int tile, int x, int y) const {
    return tile_index[(static_cast<size_t>(tile) * tile_size + y) * tile_size + x];
  }
};

// How BTFels lie in the exemplar: each is the mean over footprint x footprint pixels, of which source_pixels
// names the first, and so far do neighbouring texels of a tile lie apart. Of a tile set the footprint is 1,
// of what far scenes need of one more (refine/level_set.h).
struct SourceGrid {
  int width = 1;  // of the exemplar, pixels
  int footprint = 1;
};
// Largest of either.
inline constexpr int kMostGridWidth = 1 << 24;

// As metadata.exemplar states it; nothing where it or source_pixels is missing, or PackTexel cannot hold
// them.
[[nodiscard]] std::optional<SourceGrid> SourceGridOf(const TileSet& tile_set);

// What BTFels go by where a tile set is sent.
struct BtfelLabels {
  std::vector<uint32_t>
      pixels;  // [BTFels], ascending: source_pixels where SourceGridOf knows them, else 0, 1, ..
  SourceGrid grid;
  bool are_pixels = false;
};
[[nodiscard]] BtfelLabels LabelsOf(const TileSet& tile_set);

// What both of the functions below check. Errors: those of theirs that are about more than bytes.
[[nodiscard]] absl::Status CheckTileSet(const TileSet& tile_set);

// Container of kind "tile_set" (codec/FORMAT.md). The digest must be that of the id and the codes listed, and
// of the built-in arrangement of this id where there is one. Errors: INVALID_ARGUMENT naming the section,
// value and limit, FAILED_PRECONDITION naming both digests; ParseTileSet, safe on hostile bytes, also those
// of ParseContainer and UNIMPLEMENTED naming an unknown codec.
[[nodiscard]] absl::StatusOr<std::string> SerializeTileSet(const TileSet& tile_set);
[[nodiscard]] absl::StatusOr<TileSet> ParseTileSet(std::span<const std::byte> bytes);

}  // namespace tessera
