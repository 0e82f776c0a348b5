// The writing half of tile_set_parts.h.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <type_traits>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/btfel_table_io.h"
#include "btf/codec/container.h"
#include "btf/codec/container_frame.h"
#include "btf/wang/tile_set_index_io.h"
#include "btf/wang/tile_set_layer_io.h"
#include "btf/wang/tile_set_parts.h"
#include "btf/wang/tile_set_parts_layout.h"

namespace tessera {
namespace {

absl::Status CheckTiles(const TileSet& tile_set, const TileSetCut& cut) {
  if (std::ranges::adjacent_find(cut.tiles, std::greater_equal()) != cut.tiles.end() ||
      (!cut.tiles.empty() && cut.tiles.back() >= tile_set.tile_codes.size())) {
    return absl::InvalidArgumentError(
        absl::StrCat("tiles: not strictly ascending below ", tile_set.tile_codes.size()));
  }
  return cut.origin.is_object() ? absl::OkStatus() : absl::InvalidArgumentError("origin: not an object");
}

absl::Status CheckColumns(const TileSetCut& cut, const CoefficientTables& tables, size_t k) {
  const size_t ordered = cut.layers != nullptr && cut.ends.empty() ? 0 : k;
  std::vector<bool> seen(k, false);
  for (const uint32_t coefficient : cut.order) {
    if (coefficient >= k || seen[coefficient]) {
      return absl::InvalidArgumentError(
          absl::StrCat("order: coefficient ", coefficient, " of ", k, " is out of range or appears twice"));
    }
    seen[coefficient] = true;
  }
  const bool ascending = std::ranges::adjacent_find(cut.ends, std::greater_equal()) == cut.ends.end();
  if (k == 0 || cut.order.size() != ordered || cut.fill.size() != k || !ascending ||
      (ordered > 0 && (cut.ends.empty() || cut.ends.front() == 0 || cut.ends.back() != k))) {
    return absl::InvalidArgumentError(absl::StrCat("order of ", cut.order.size(), ", fill of ",
                                                   cut.fill.size(), ", parts of ",
                                                   cut.ends.empty() ? 0 : cut.ends.back(), ", expected ", k));
  }
  for (size_t i = 0; i < k; ++i) {
    const bool is_zero = cut.fill[i] == 0.0F;
    if (!std::isfinite(cut.fill[i]) || (tables.NeedsEntries(static_cast<uint32_t>(i)) && !is_zero)) {
      return absl::InvalidArgumentError(absl::StrCat("fill: ", cut.fill[i], " for coefficient ", i));
    }
  }
  return absl::OkStatus();
}

// Whether the layers can be added up.
absl::Status CheckLayers(const TileSetCut& cut, const TileSet& tile_set, const CoefficientTables& tables,
                         size_t k) {
  const TileSetLayers& layers = *cut.layers;
  if (layers.mean.size() != k || layers.scale.size() != k || layers.layers.empty() || layers.block_side < 1 ||
      layers.block_side > kMostBlockSide || layers.level < 0 || layers.level > kMostLevel) {
    return absl::InvalidArgumentError(absl::StrCat(
        layers.layers.size(), " layers, mean of ", layers.mean.size(), ", scale of ", layers.scale.size(),
        ", expected ", k, ", blocks of side ", layers.block_side, ", level ", layers.level));
  }
  std::vector<bool> is_taken(k, false);
  for (size_t i = 0; i < (cut.ends.empty() ? 0 : cut.ends[0]); ++i) {
    is_taken[cut.order[i]] = true;
  }
  for (const uint32_t coefficient : layers.coefficients) {
    if (coefficient >= k || is_taken[coefficient]) {
      return absl::InvalidArgumentError(absl::StrCat("layers: coefficient ", coefficient, " of ", k,
                                                     " is out of range, appears twice or is exact before"));
    }
    is_taken[coefficient] = true;
  }
  std::optional<CoreSum> cores;
  if (layers.bases.has_value()) {
    if (!cut.ends.empty()) {
      return absl::InvalidArgumentError("layers: tables come as cores, and exact coefficients follow");
    }
    TESSERA_ASSIGN_OR_RETURN(
        cores, CoreSum::Create(tile_set.btfels, AngularTablesOf(tile_set.btfels, tables), *layers.bases));
  }
  const BtfelLabels labels = LabelsOf(tile_set);
  LayerSum sum(BlocksOf(labels.pixels, labels.grid, layers.block_side, layers.level), layers.coefficients,
               layers.mean, layers.scale);
  for (const TileSetLayer& layer : layers.layers) {
    TESSERA_RETURN_IF_ERROR(sum.Add(layer));
    if (!layer.cores.empty()) {
      if (!cores.has_value()) {
        return absl::InvalidArgumentError("layers: codes of cores, but no bases");
      }
      TESSERA_RETURN_IF_ERROR(cores->Add(layer.core_step, layer.cores));
    }
  }
  return absl::OkStatus();
}

// The chosen entries of a table as they are stored; values of u8 and u16 tables are whole numbers, and
// smooth.
Section TableSection(const std::string& name, const CodecTable& table, std::span<const int64_t> entries) {
  const auto gather = [&]<typename T>(T) {
    std::vector<T> values;
    values.reserve(entries.size());
    for (const int64_t entry : entries) {
      values.push_back(static_cast<T>(table.values[static_cast<size_t>(entry)]));
    }
    if constexpr (std::is_integral_v<T>) {
      std::adjacent_difference(values.begin(), values.end(), values.begin());
    }
    return MakeSection<T>(name, {static_cast<int64_t>(entries.size())}, std::span<const T>(values));
  };
  switch (table.dtype) {
    case DType::kU8:
      return gather(uint8_t{});
    case DType::kU16:
      return gather(uint16_t{});
    default:
      return gather(float{});
  }
}

std::vector<int64_t> AllEntries(const CodecTable& table) {
  std::vector<int64_t> entries(table.values.size());
  for (size_t i = 0; i < entries.size(); ++i) {
    entries[i] = static_cast<int64_t>(i);
  }
  return entries;
}

}  // namespace

absl::StatusOr<TileSetCutter> TileSetCutter::Create(const TileSet& tile_set, TileSetCut cut) {
  TESSERA_RETURN_IF_ERROR(CheckTiles(tile_set, cut));
  TESSERA_ASSIGN_OR_RETURN(CoefficientTables tables, CoefficientTables::Of(tile_set.btfels));
  const size_t texels_per_tile = static_cast<size_t>(tile_set.tile_size) * tile_set.tile_size;
  if (tile_set.tile_size < 1 || tile_set.tile_codes.empty() ||
      tile_set.tile_index.size() != tile_set.tile_codes.size() * texels_per_tile) {
    return absl::InvalidArgumentError(absl::StrCat(tile_set.tile_index.size(), " texels for ",
                                                   tile_set.tile_codes.size(), " tiles of ",
                                                   tile_set.tile_size, "x", tile_set.tile_size));
  }
  for (const uint32_t texel : tile_set.tile_index) {
    if (BtfelOfTexel(texel) >= tile_set.btfels.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("a texel names BTFel ", BtfelOfTexel(texel), " of ", tile_set.btfels.size()));
    }
  }
  const auto k = static_cast<size_t>(std::max(tile_set.btfels.num_coefficients, 0));
  TESSERA_RETURN_IF_ERROR(CheckColumns(cut, tables, k));
  if (cut.layers != nullptr) {
    TESSERA_RETURN_IF_ERROR(CheckLayers(cut, tile_set, tables, k));
  }
  TileSetCutter cutter(tile_set, std::move(cut), std::move(tables));
  cutter.FindBtfels();
  cutter.FindBlocks();
  return cutter;
}

TileSetCutter::Piece TileSetCutter::PieceOf(size_t part) const {
  const size_t before = std::min<size_t>(cut_.ends.size(), 1);  // prefixes before the layers
  if (part < before) {
    return {.is_layer = false, .index = part};
  }
  return part - before < num_layers() ? Piece{.is_layer = true, .index = part - before}
                                      : Piece{.is_layer = false, .index = part - num_layers()};
}

std::vector<uint32_t> TileSetCutter::CoefficientsOf(const Piece& piece) const {
  if (piece.is_layer) {
    return piece.index == 0 ? cut_.layers->coefficients : std::vector<uint32_t>();
  }
  const size_t begin = piece.index == 0 ? 0 : cut_.ends[piece.index - 1];
  return {cut_.order.begin() + static_cast<std::ptrdiff_t>(begin),
          cut_.order.begin() + static_cast<std::ptrdiff_t>(cut_.ends[piece.index])};
}

std::vector<uint32_t> TileSetCutter::CoefficientsBefore(size_t part) const {
  std::vector<bool> held(cut_.fill.size(), false);
  std::vector<uint32_t> before;
  for (size_t i = 0; i < part; ++i) {
    for (const uint32_t coefficient : CoefficientsOf(PieceOf(i))) {
      if (!held[coefficient]) {
        held[coefficient] = true;
        before.push_back(coefficient);
      }
    }
  }
  return before;
}

size_t TileSetCutter::num_coefficients(size_t part) const {
  return CoefficientsBefore(part + 1).size();
}

void TileSetCutter::FindBtfels() {
  std::vector<bool> used(tile_set_->btfels.size(), false);
  ForTiles(cut_.tiles, tile_set_->tile_codes.size(), [&](size_t tile) {
    const size_t texels = static_cast<size_t>(tile_set_->tile_size) * tile_set_->tile_size;
    for (size_t i = tile * texels; i < (tile + 1) * texels; ++i) {
      used[BtfelOfTexel(tile_set_->tile_index[i])] = true;
    }
  });
  for (size_t btfel = 0; btfel < used.size(); ++btfel) {
    if (used[btfel]) {
      btfels_.push_back(static_cast<uint32_t>(btfel));
    }
  }
}

void TileSetCutter::FindBlocks() {
  if (cut_.layers == nullptr) {
    return;
  }
  const BtfelLabels labels = LabelsOf(*tile_set_);
  const LayerBlocks all = BlocksOf(labels.pixels, labels.grid, cut_.layers->block_side, cut_.layers->level);
  num_blocks_ = all.size();
  for (const uint32_t btfel : btfels_) {
    blocks_.push_back(all.places[btfel] / static_cast<uint32_t>(all.side * all.side));
  }
  std::ranges::sort(blocks_);
  blocks_.erase(std::ranges::unique(blocks_).begin(), blocks_.end());
}

absl::Status TileSetCutter::AddHead(Container& container) const {
  const BtfelTable& table = tile_set_->btfels;
  nlohmann::json tables = nlohmann::json::object();
  for (const auto& [name, codec_table] : table.tables) {
    tables[name] = {{"shape", codec_table.shape}, {"dtype", DTypeName(codec_table.dtype)}};
  }
  container.header["codec"] = {{"id", table.codec_id},
                               {"version", table.codec_version},
                               {"parameters", table.parameters},
                               {"tables", std::move(tables)}};
  container.header["arrangement"] = {{"id", tile_set_->arrangement_id},
                                     {"sha256", tile_set_->arrangement_sha256}};
  container.header["strip_height"] = tile_set_->strip_height;
  container.header["radiometry"] = tile_set_->radiometry;
  const BtfelLabels labels = LabelsOf(*tile_set_);
  container.header["labels"] = labels.are_pixels ? kPixelLabels : kBtfelLabels;
  container.header["exemplar_width"] = labels.grid.width;
  container.header["footprint"] = labels.grid.footprint;
  container.header["tile_size"] = tile_set_->tile_size;
  container.header["origin"] = cut_.origin;
  AddProvenance(tile_set_->provenance, container);

  const auto texels = static_cast<size_t>(tile_set_->tile_size) * static_cast<size_t>(tile_set_->tile_size);
  std::vector<uint32_t> index;
  ForTiles(cut_.tiles, tile_set_->tile_codes.size(), [&](size_t tile) {
    for (size_t i = tile * texels; i < (tile + 1) * texels; ++i) {
      const uint32_t texel = tile_set_->tile_index[i];
      index.push_back(PackTexel(labels.pixels[BtfelOfTexel(texel)], TurnsOfTexel(texel)));
    }
  });
  AddVector("tile_codes", tile_set_->tile_codes, container);
  AddVector("tiles", cut_.tiles, container);
  AddIndexSections(index, tile_set_->tile_size, labels.grid, container);
  AddVector("fill", cut_.fill, container);
  TESSERA_RETURN_IF_ERROR(AddDirections("views", table.views, container));
  TESSERA_RETURN_IF_ERROR(AddDirections("lights", table.lights, container));
  for (const auto& [name, codec_table] : table.tables) {
    if (!tables_.IsSplit(name)) {
      container.sections.push_back(TableSection(name, codec_table, AllEntries(codec_table)));
    }
  }
  return absl::OkStatus();
}

void TileSetCutter::AddColumns(size_t part, Container& container) const {
  const BtfelTable& table = tile_set_->btfels;
  const std::vector<uint32_t> columns = CoefficientsOf(PieceOf(part));
  std::vector<float> offset;
  std::vector<float> step;
  for (const uint32_t coefficient : columns) {
    offset.push_back(table.offset[coefficient]);
    step.push_back(table.step[coefficient]);
  }
  AddVector("coefficients", columns, container);
  AddVector("offset", offset, container);
  AddVector("step", step, container);
  AddEntries(columns, CoefficientsBefore(part), container);
  Section codes;
  codes.name = absl::StrCat("btfels.", part);
  codes.dtype = DType::kU8;
  codes.shape = {static_cast<int64_t>(btfels_.size()), static_cast<int64_t>(columns.size())};
  codes.bytes.resize(btfels_.size() * columns.size());
  char* to = codes.bytes.data();
  for (const uint32_t btfel : btfels_) {
    const uint8_t* const from = table.codes.data() + static_cast<size_t>(btfel) * table.num_coefficients;
    for (const uint32_t coefficient : columns) {
      *to++ = static_cast<char>(from[coefficient]);
    }
  }
  container.sections.push_back(std::move(codes));
}

bool TileSetCutter::IsCored(const std::string& table) const {
  if (cut_.layers == nullptr || !cut_.layers->bases.has_value()) {
    return false;
  }
  const std::vector<AngularTable> angular = AngularTablesOf(tile_set_->btfels, tables_);
  return std::ranges::find(angular, table, &AngularTable::name) != angular.end();
}

void TileSetCutter::AddEntries(std::span<const uint32_t> coefficients, std::span<const uint32_t> before,
                               Container& container) const {
  for (const auto& [name, codec_table] : tile_set_->btfels.tables) {
    if (tables_.IsSplit(name) && !IsCored(name)) {
      const std::vector<int64_t> entries = tables_.EntriesOf(name, coefficients, before);
      if (!entries.empty()) {
        container.sections.push_back(TableSection(name, codec_table, entries));
      }
    }
  }
}

void TileSetCutter::AddLayer(size_t part, Container& container) const {
  const TileSetLayers& layers = *cut_.layers;
  const size_t index = PieceOf(part).index;
  if (index == 0) {
    AddSharedSections(layers, container);
    AddEntries(layers.coefficients, CoefficientsBefore(part), container);
  }
  AddLayerSections(layers, index, blocks_, num_blocks_, container);
}

absl::StatusOr<std::string> TileSetCutter::Part(size_t index, std::string_view first_sha256) const {
  Container container;
  container.kind = kTileSetPartKind;
  container.header["part"] = index;
  container.header["parts"] = num_parts();
  if (index == 0) {
    TESSERA_RETURN_IF_ERROR(AddHead(container));
  } else {
    container.header["first_sha256"] = first_sha256;
  }
  if (PieceOf(index).is_layer) {
    AddLayer(index, container);
  } else {
    AddColumns(index, container);
  }
  return FrameContainer(std::move(container));
}

}  // namespace tessera
