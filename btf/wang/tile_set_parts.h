// A tile set cut into parts that arrive one after the other: the first can be drawn, each further one brings
// more coefficients. A part is a container of kind "tile_set_part" (codec/FORMAT.md), framed.
//
//   TESSERA_ASSIGN_OR_RETURN(auto cutter, TileSetCutter::Create(tile_set, cut));
//   TESSERA_ASSIGN_OR_RETURN(std::string first, cutter.Part(0, ""));
//   TESSERA_ASSIGN_OR_RETURN(std::string second, cutter.Part(1, Sha256Hex(first)));
//   ..
//   TESSERA_ASSIGN_OR_RETURN(auto assembler, TileSetAssembler::Begin(first));
//   TESSERA_RETURN_IF_ERROR(assembler.Add(second));   // at any time: assembler.tile_set()
//
// Parts bring coefficients as they are, or coarse ones in layers (tile_set_layers.h), or the exact ones in
// their place. A coefficient that is not here yet has one value for all texels, its `fill`: the mean where
// that needs no entry of a codec's table, else 0.
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

// How a tile set is cut: by coefficients, into layers, or both, the first coefficients before the layers and
// the others after them.
struct TileSetCut {
  std::vector<uint32_t> tiles;  // ascending, each once; none: all
  std::vector<uint32_t> order;  // [k], a permutation of the coefficients; of layers alone empty
  std::vector<uint32_t> ends;   // prefix i adds order[ends[i - 1]] .. order[ends[i] - 1]; ascending up to k
  std::vector<float> fill;      // [k], finite; 0 where CoefficientTables::NeedsEntries
  // May be null. Of coefficients that the first prefix brings nothing.
  std::shared_ptr<const TileSetLayers> layers;
  // What the parts were cut from: `tile_set_sha256`, `level`, ..; recorded in the assembled set.
  nlohmann::json origin = nlohmann::json::object();
};

// Immutable and thread-safe; borrows the tile set.
class TileSetCutter {
 public:
  // Errors: INVALID_ARGUMENT naming what of the tile set or the cut is misshapen.
  [[nodiscard]] static absl::StatusOr<TileSetCutter> Create(const TileSet& tile_set, TileSetCut cut);

  [[nodiscard]] size_t num_parts() const { return cut_.ends.size() + num_layers(); }
  // That a part below num_parts() and those before it bring.
  [[nodiscard]] size_t num_coefficients(size_t part) const;
  // Of the tiles.
  [[nodiscard]] size_t num_btfels() const { return btfels_.size(); }
  // The bytes of a part below num_parts(). All but the first name the first, by its SHA-256. Same arguments,
  // same bytes. Errors: those of FrameContainer.
  [[nodiscard]] absl::StatusOr<std::string> Part(size_t index, std::string_view first_sha256) const;

 private:
  TileSetCutter(const TileSet& tile_set, TileSetCut cut, CoefficientTables tables)
      : tile_set_(&tile_set), cut_(std::move(cut)), tables_(std::move(tables)) {}

  // What a part brings.
  struct Piece {
    bool is_layer = false;
    size_t index = 0;  // of the layer or prefix
  };

  void FindBtfels();
  void FindBlocks();
  [[nodiscard]] size_t num_layers() const { return cut_.layers == nullptr ? 0 : cut_.layers->layers.size(); }
  [[nodiscard]] Piece PieceOf(size_t part) const;
  [[nodiscard]] std::vector<uint32_t> CoefficientsOf(const Piece& piece) const;
  // That the parts before it bring, each once.
  [[nodiscard]] std::vector<uint32_t> CoefficientsBefore(size_t part) const;
  [[nodiscard]] absl::Status AddHead(Container& container) const;
  void AddColumns(size_t part, Container& container) const;
  void AddLayer(size_t part, Container& container) const;
  // Whether a table comes as cores.
  [[nodiscard]] bool IsCored(const std::string& table) const;
  // Entries of tables that belong to these coefficients and to none of those before.
  void AddEntries(std::span<const uint32_t> coefficients, std::span<const uint32_t> before,
                  Container& container) const;

  const TileSet* tile_set_;
  TileSetCut cut_;
  CoefficientTables tables_;
  std::vector<uint32_t> btfels_;  // those that the tiles reference, ascending
  std::vector<uint32_t> blocks_;  // where there are layers, those of num_blocks_ that these lie in
  size_t num_blocks_ = 0;
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
  // Not const: layers are added up when their sum is asked for.
  [[nodiscard]] const TileSet& tile_set() {
    Quantize();
    return tile_set_;
  }
  [[nodiscard]] TileSet Take() && {
    Quantize();
    return std::move(tile_set_);
  }
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
  // Whether they are in range, each once, and not among those before.
  [[nodiscard]] absl::Status CheckNew(std::span<const uint32_t> coefficients,
                                      std::span<const uint32_t> before) const;
  [[nodiscard]] absl::Status BeginLayers(const Container& container);
  [[nodiscard]] absl::Status AddPart(const Container& container);
  [[nodiscard]] absl::Status AddColumns(const Container& container);
  [[nodiscard]] absl::Status AddLayer(const Container& container);
  [[nodiscard]] absl::Status SumLayer(const Container& container, bool is_first);
  void Hold(std::span<const uint32_t> coefficients);
  // All BTFels become what the layers say, but for exact coefficients.
  void Quantize();
  // The shared tables with the entries that these coefficients need; no codes.
  [[nodiscard]] absl::StatusOr<BtfelTable> TablesWith(std::span<const uint32_t> coefficients,
                                                      const Container& container) const;
  // Whether the table comes as cores.
  [[nodiscard]] bool IsCored(const std::string& table) const;
  void Record();

  TileSet tile_set_;
  std::string first_sha256_;
  nlohmann::json origin_ = nlohmann::json::object();
  std::vector<uint32_t> tiles_;
  std::optional<CoefficientTables> tables_;
  std::vector<uint32_t> held_;      // coefficients, each once
  std::vector<bool> is_held_;       // [k]
  std::vector<uint32_t> exact_;     // of these, those that no layer makes
  std::optional<LayerSum> layers_;  // once the first has come
  std::optional<CoreSum> cores_;    // where tables come as cores
  bool is_stale_ = false;           // they are not in the tile set yet
  SourceGrid grid_;
  std::vector<uint32_t> labels_;  // [BTFels]
  size_t num_btfels_ = 0;
  size_t num_parts_ = 0;
  size_t parts_ = 0;  // that there are
};

// The tiles that an assembled tile set holds, ascending; nothing where it holds all.
[[nodiscard]] std::optional<std::vector<uint32_t>> TilesHeld(const TileSet& tile_set);

}  // namespace tessera
