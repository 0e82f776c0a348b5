// A tile set cut into parts that arrive one after the other: the first can be drawn, each further one brings
// more coefficients. A part is a container of kind "tile_set_part" (codec/FORMAT.md).
//
//   TESSERA_ASSIGN_OR_RETURN(auto cutter, TileSetCutter::Create(tile_set, cut));
//   TESSERA_ASSIGN_OR_RETURN(std::string first, cutter.Part(0, ""));
//   TESSERA_ASSIGN_OR_RETURN(std::string second, cutter.Part(1, Sha256Hex(first)));
//   ..
//   TESSERA_ASSIGN_OR_RETURN(auto assembler, TileSetAssembler::Begin(first));
//   TESSERA_RETURN_IF_ERROR(assembler.Add(second));   // at any time: assembler.tile_set()
//
// Parts bring coefficients, one after the other, or all that they hold in layers, coarse first
// (tile_set_layers.h). A coefficient that is not here yet has one value for all texels: its mean, or, cut by
// coefficients, 0 where it means nothing without entries of a codec's table.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/codec/coefficient_tables.h"
#include "btf/wang/tile_set.h"
#include "btf/wang/tile_set_layers.h"

namespace tessera {

// How a tile set is cut: by coefficients, or into layers.
struct TileSetCut {
  std::vector<uint32_t> tiles;  // ascending, each once; none: all
  std::vector<uint32_t> order;  // [k], a permutation of the coefficients
  std::vector<uint32_t> ends;   // part i holds order[ends[i - 1]] .. order[ends[i] - 1]; ascending up to k
  std::vector<float> fill;      // [k], finite; 0 where CoefficientTables::NeedsEntries
  // Where given, part i is layer i; order, ends and fill are not used. Each texel is a BTFel of its own,
  // then.
  std::shared_ptr<const TileSetLayers> layers;
  // What the parts were cut from: `tile_set_sha256`, `level`, ..; recorded in the assembled set.
  nlohmann::json origin = nlohmann::json::object();
};

// Immutable and thread-safe; borrows the tile set.
class TileSetCutter {
 public:
  // Errors: INVALID_ARGUMENT naming what of the tile set or the cut is misshapen.
  [[nodiscard]] static absl::StatusOr<TileSetCutter> Create(const TileSet& tile_set, TileSetCut cut);

  [[nodiscard]] size_t num_parts() const {
    return cut_.layers == nullptr ? cut_.ends.size() : cut_.layers->layers.size();
  }
  // That a part below num_parts() and those before it bring.
  [[nodiscard]] size_t num_coefficients(size_t part) const;
  // Of the tiles.
  [[nodiscard]] size_t num_btfels() const { return num_btfels_; }
  // The bytes of a part below num_parts(). All but the first name the first, by its SHA-256. Same arguments,
  // same bytes. Errors: those of SerializeContainer.
  [[nodiscard]] absl::StatusOr<std::string> Part(size_t index, std::string_view first_sha256) const;

 private:
  TileSetCutter(const TileSet& tile_set, TileSetCut cut, CoefficientTables tables)
      : tile_set_(&tile_set), cut_(std::move(cut)), tables_(std::move(tables)) {}

  void FindBtfels();
  [[nodiscard]] size_t num_tiles() const;
  [[nodiscard]] bool KnowsPixels() const;
  [[nodiscard]] std::vector<uint32_t> Labels() const;
  [[nodiscard]] absl::Status AddHead(Container& container) const;
  void AddColumns(size_t index, Container& container) const;
  void AddLayer(size_t index, Container& container) const;
  // Entries of tables that belong to these coefficients and to none of those before.
  void AddEntries(std::span<const uint32_t> coefficients, std::span<const uint32_t> before,
                  Container& container) const;

  const TileSet* tile_set_;
  TileSetCut cut_;
  CoefficientTables tables_;
  std::vector<uint32_t> btfels_;  // those that the tiles reference, ascending; not of layers
  size_t num_btfels_ = 0;
};

// A tile set as it grows. After an error of Add it is what it was before. Not thread-safe.
class TileSetAssembler {
 public:
  // From the bytes of the first part. Safe on hostile bytes: what it allocates stays below 2 GiB. Errors:
  // INVALID_ARGUMENT naming the section, its value and the limit; those of ParseContainer and MakeDecoder.
  [[nodiscard]] static absl::StatusOr<TileSetAssembler> Begin(std::span<const std::byte> part);

  // The next part. Errors: likewise; FAILED_PRECONDITION when it is another part than the next, or one of
  // another tile set.
  [[nodiscard]] absl::Status Add(std::span<const std::byte> part);

  // Tiles that were not asked for are flat; Redress refuses dressings that show them. `metadata` has an
  // object `part`: the origin, `tiles` (where not all are here), `num_coefficients` that are here.
  [[nodiscard]] const TileSet& tile_set() const { return tile_set_; }
  [[nodiscard]] TileSet Take() && { return std::move(tile_set_); }
  [[nodiscard]] const nlohmann::json& origin() const { return origin_; }
  // Ascending; none: all.
  [[nodiscard]] const std::vector<uint32_t>& tiles() const { return tiles_; }
  [[nodiscard]] size_t num_parts() const { return num_parts_; }
  [[nodiscard]] size_t num_coefficients() const { return held_.size(); }
  // Whether all parts are here.
  [[nodiscard]] bool is_complete() const { return num_parts_ == parts_; }

 private:
  TileSetAssembler() = default;

  [[nodiscard]] absl::Status ReadHead(const Container& container);
  [[nodiscard]] absl::Status ReadTables(const nlohmann::json& header, const Container& container);
  [[nodiscard]] absl::Status ReadTiles(const Container& container);
  [[nodiscard]] absl::Status CheckNew(std::span<const uint32_t> coefficients) const;
  [[nodiscard]] absl::Status AddPart(const Container& container);
  [[nodiscard]] absl::Status AddColumns(const Container& container);
  [[nodiscard]] absl::Status AddLayer(const Container& container);
  // The shared tables with the entries that these coefficients need; no codes.
  [[nodiscard]] absl::StatusOr<BtfelTable> TablesWith(std::span<const uint32_t> coefficients,
                                                      const Container& container) const;
  void Record();

  TileSet tile_set_;
  std::string first_sha256_;
  nlohmann::json origin_ = nlohmann::json::object();
  std::vector<uint32_t> tiles_;
  std::optional<CoefficientTables> tables_;
  std::vector<uint32_t> held_;      // coefficients
  std::optional<LayerSum> layers_;  // of a set that comes in layers
  size_t num_btfels_ = 0;
  size_t num_parts_ = 0;
  size_t parts_ = 0;  // that there are
};

// The tiles that an assembled tile set holds, ascending; nothing where it holds all.
[[nodiscard]] std::optional<std::vector<uint32_t>> TilesHeld(const TileSet& tile_set);

}  // namespace tessera
