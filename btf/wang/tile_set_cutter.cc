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
absl::Status CheckLayers(const TileSetCut& cut, const TileSet& tile_set, size_t k) {
  const TileSetLayers& layers = *cut.layers;
  const size_t block = static_cast<size_t>(std::max(layers.block_side, 0)) *
                       static_cast<size_t>(std::max(layers.block_side, 0));
  if (layers.mean.size() != k || layers.scale.size() != k || layers.layers.empty() || block == 0 ||
      tile_set.btfels.size() % block != 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        layers.layers.size(), " layers, mean of ", layers.mean.size(), ", scale of ", layers.scale.size(),
        ", expected ", k, ", blocks of ", block, " of ", tile_set.btfels.size(), " BTFels"));
  }
  for (const auto& [name, table] : layers.tables) {
    const auto of_set = tile_set.btfels.tables.find(name);
    if (of_set == tile_set.btfels.tables.end() || of_set->second.dtype != table.dtype ||
        of_set->second.values.size() != table.values.size() || !cut.ends.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat("layers: table '", name, "' is not the tile set's, or exact coefficients follow"));
    }
  }
  LayerSum sum(layers.block_side, tile_set.btfels.size() / block, layers.mean, layers.scale);
  for (const TileSetLayer& layer : layers.layers) {
    for (size_t i = 0; i < (cut.ends.empty() ? 0 : cut.ends[0]); ++i) {
      if (std::ranges::find(layer.coefficients, cut.order[i]) != layer.coefficients.end()) {
        return absl::InvalidArgumentError(
            absl::StrCat("layers: coefficient ", cut.order[i], " is exact before they come"));
      }
    }
    TESSERA_RETURN_IF_ERROR(sum.Add(layer));
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
      return Compressed(gather(uint8_t{}));
    case DType::kU16:
      return Compressed(gather(uint16_t{}));
    default:
      return Compressed(gather(float{}));
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
    TESSERA_RETURN_IF_ERROR(CheckLayers(cut, tile_set, k));
  }
  TileSetCutter cutter(tile_set, std::move(cut), std::move(tables));
  cutter.FindBtfels();
  TESSERA_RETURN_IF_ERROR(cutter.FindBlocks());
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
    return cut_.layers->layers[piece.index].coefficients;
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

absl::Status TileSetCutter::FindBlocks() {
  if (cut_.layers == nullptr) {
    return absl::OkStatus();
  }
  const auto block = static_cast<uint32_t>(cut_.layers->block_side * cut_.layers->block_side);
  for (size_t i = 0; i < btfels_.size(); ++i) {
    if (btfels_[i] % block != i % block) {
      return absl::InvalidArgumentError(
          absl::StrCat("tiles show BTFel ", btfels_[i], " without the others of its block of ", block));
    }
    if (i % block == 0) {
      blocks_.push_back(btfels_[i] / block);
    }
  }
  return btfels_.size() % block == 0
             ? absl::OkStatus()
             : absl::InvalidArgumentError(
                   absl::StrCat("tiles show ", btfels_.size(), " BTFels, not whole blocks of ", block));
}

bool TileSetCutter::KnowsPixels() const {
  const std::vector<uint32_t>& pixels = tile_set_->source_pixels;
  return pixels.size() == tile_set_->btfels.size() && !pixels.empty() && pixels.back() <= kLargestLabel;
}

std::vector<uint32_t> TileSetCutter::Labels() const {
  if (KnowsPixels()) {
    return tile_set_->source_pixels;
  }
  const size_t num_btfels = tile_set_->btfels.size();
  std::vector<uint32_t> labels(num_btfels);
  for (size_t i = 0; i < num_btfels; ++i) {
    labels[i] = static_cast<uint32_t>(i);
  }
  return labels;
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
  container.header["labels"] = KnowsPixels() ? kPixelLabels : kBtfelLabels;
  container.header["origin"] = cut_.origin;
  AddProvenance(tile_set_->provenance, container);

  const auto w = static_cast<int64_t>(tile_set_->tile_size);
  const std::vector<uint32_t> labels = Labels();
  std::vector<uint32_t> index;
  ForTiles(cut_.tiles, tile_set_->tile_codes.size(), [&](size_t tile) {
    std::vector<uint32_t> texels(static_cast<size_t>(w * w));
    for (size_t i = 0; i < texels.size(); ++i) {
      const uint32_t texel = tile_set_->tile_index[tile * texels.size() + i];
      texels[i] = PackTexel(labels[BtfelOfTexel(texel)], TurnsOfTexel(texel));
    }
    PredictTexels(tile_set_->tile_size, texels);
    index.insert(index.end(), texels.begin(), texels.end());
  });
  const auto num_tiles = static_cast<int64_t>(index.size()) / (w * w);
  container.sections.push_back(Compressed(MakeSection<uint32_t>(
      "tile_codes", {static_cast<int64_t>(tile_set_->tile_codes.size())}, tile_set_->tile_codes)));
  if (!cut_.tiles.empty()) {
    container.sections.push_back(Compressed(MakeSection<uint32_t>("tiles", {num_tiles}, cut_.tiles)));
  }
  container.sections.push_back(Compressed(MakeSection<uint32_t>("tile_index", {num_tiles, w, w}, index)));
  container.sections.push_back(
      Compressed(MakeSection<float>("fill", {table.num_coefficients}, std::span<const float>(cut_.fill))));
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
  const auto count = static_cast<int64_t>(columns.size());
  std::vector<float> offset;
  std::vector<float> step;
  for (const uint32_t coefficient : columns) {
    offset.push_back(table.offset[coefficient]);
    step.push_back(table.step[coefficient]);
  }
  container.sections.push_back(
      Compressed(MakeSection<uint32_t>("coefficients", {count}, std::span<const uint32_t>(columns))));
  container.sections.push_back(
      Compressed(MakeSection<float>("offset", {count}, std::span<const float>(offset))));
  container.sections.push_back(Compressed(MakeSection<float>("step", {count}, std::span<const float>(step))));
  AddEntries(columns, CoefficientsBefore(part), container);
  Section codes;
  codes.name = absl::StrCat("btfels.", part);
  codes.dtype = DType::kU8;
  codes.shape = {static_cast<int64_t>(btfels_.size()), count};
  codes.bytes.resize(btfels_.size() * columns.size());
  char* to = codes.bytes.data();
  for (const uint32_t btfel : btfels_) {
    const uint8_t* const from = table.codes.data() + static_cast<size_t>(btfel) * table.num_coefficients;
    for (const uint32_t coefficient : columns) {
      *to++ = static_cast<char>(from[coefficient]);
    }
  }
  container.sections.push_back(Compressed(std::move(codes)));
}

void TileSetCutter::AddEntries(std::span<const uint32_t> coefficients, std::span<const uint32_t> before,
                               Container& container) const {
  for (const auto& [name, codec_table] : tile_set_->btfels.tables) {
    if (tables_.IsSplit(name)) {
      const CodecTable* table = &codec_table;
      if (cut_.layers != nullptr && cut_.layers->tables.contains(name)) {
        table = &cut_.layers->tables.at(name);
      }
      container.sections.push_back(TableSection(name, *table, tables_.EntriesOf(name, coefficients, before)));
    }
  }
}

void TileSetCutter::AddLayer(size_t part, Container& container) const {
  const TileSetLayers& layers = *cut_.layers;
  const size_t index = PieceOf(part).index;
  if (index == 0) {
    container.header["block_side"] = layers.block_side;
    const auto k = static_cast<int64_t>(layers.mean.size());
    container.sections.push_back(
        Compressed(MakeSection<float>("mean", {k}, std::span<const float>(layers.mean))));
    container.sections.push_back(
        Compressed(MakeSection<float>("scale", {k}, std::span<const float>(layers.scale))));
  }
  const auto block = static_cast<size_t>(layers.block_side) * static_cast<size_t>(layers.block_side);
  AddLayerSections(layers, index, blocks_, tile_set_->btfels.size() / block, container);
  AddEntries(layers.layers[index].coefficients, CoefficientsBefore(part), container);
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
  return SerializeContainer(std::move(container));
}

}  // namespace tessera
