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
  std::vector<bool> seen(k, false);
  for (const uint32_t coefficient : cut.order) {
    if (coefficient >= k || seen[coefficient]) {
      return absl::InvalidArgumentError(
          absl::StrCat("order: coefficient ", coefficient, " of ", k, " is out of range or appears twice"));
    }
    seen[coefficient] = true;
  }
  const bool ascending = std::ranges::adjacent_find(cut.ends, std::greater_equal()) == cut.ends.end();
  if (k == 0 || cut.order.size() != k || cut.fill.size() != k || cut.ends.empty() || !ascending ||
      cut.ends.front() == 0 || cut.ends.back() != k) {
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
absl::Status CheckLayers(const TileSetLayers& layers, const TileSet& tile_set, size_t k) {
  if (k == 0 || layers.mean.size() != k || layers.scale.size() != k || layers.layers.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(layers.layers.size(), " layers, mean of ",
                                                   layers.mean.size(), ", scale of ", layers.scale.size(),
                                                   ", expected ", k));
  }
  for (const auto& [name, table] : layers.tables) {
    const auto of_set = tile_set.btfels.tables.find(name);
    if (of_set == tile_set.btfels.tables.end() || of_set->second.dtype != table.dtype ||
        of_set->second.values.size() != table.values.size()) {
      return absl::InvalidArgumentError(absl::StrCat("layers: table '", name, "' is not the tile set's"));
    }
  }
  LayerSum sum(tile_set.tile_size, tile_set.tile_codes.size(), layers.mean, layers.scale);
  for (const TileSetLayer& layer : layers.layers) {
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
  TESSERA_RETURN_IF_ERROR(cut.layers == nullptr ? CheckColumns(cut, tables, k)
                                                : CheckLayers(*cut.layers, tile_set, k));
  TileSetCutter cutter(tile_set, std::move(cut), std::move(tables));
  cutter.FindBtfels();
  return cutter;
}

size_t TileSetCutter::num_tiles() const {
  return cut_.tiles.empty() ? tile_set_->tile_codes.size() : cut_.tiles.size();
}

size_t TileSetCutter::num_coefficients(size_t part) const {
  if (cut_.layers == nullptr) {
    return cut_.ends[part];
  }
  size_t count = 0;
  for (size_t i = 0; i <= part; ++i) {
    count += cut_.layers->layers[i].coefficients.size();
  }
  return count;
}

void TileSetCutter::FindBtfels() {
  if (cut_.layers != nullptr) {
    num_btfels_ = num_tiles() * static_cast<size_t>(tile_set_->tile_size) * tile_set_->tile_size;
    return;
  }
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
  num_btfels_ = btfels_.size();
}

bool TileSetCutter::KnowsPixels() const {
  const std::vector<uint32_t>& pixels = tile_set_->source_pixels;
  return cut_.layers == nullptr && pixels.size() == tile_set_->btfels.size() && !pixels.empty() &&
         pixels.back() <= kLargestLabel;
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
  const bool by_layers = cut_.layers != nullptr;
  std::vector<uint32_t> index;
  ForTiles(cut_.tiles, tile_set_->tile_codes.size(), [&](size_t tile) {
    std::vector<uint32_t> texels(static_cast<size_t>(w * w));
    for (size_t i = 0; i < texels.size(); ++i) {
      const uint32_t texel = tile_set_->tile_index[tile * texels.size() + i];
      const uint32_t label =
          by_layers ? static_cast<uint32_t>(tile * texels.size() + i) : labels[BtfelOfTexel(texel)];
      texels[i] = PackTexel(label, TurnsOfTexel(texel));
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
  const auto add = [&](const char* name, std::span<const float> values) {
    container.sections.push_back(Compressed(MakeSection<float>(name, {table.num_coefficients}, values)));
  };
  add("fill", by_layers ? cut_.layers->mean : cut_.fill);
  if (by_layers) {
    add("scale", cut_.layers->scale);
  }
  TESSERA_RETURN_IF_ERROR(AddDirections("views", table.views, container));
  TESSERA_RETURN_IF_ERROR(AddDirections("lights", table.lights, container));
  for (const auto& [name, codec_table] : table.tables) {
    if (!tables_.IsSplit(name)) {
      container.sections.push_back(TableSection(name, codec_table, AllEntries(codec_table)));
    }
  }
  return absl::OkStatus();
}

void TileSetCutter::AddColumns(size_t index, Container& container) const {
  const BtfelTable& table = tile_set_->btfels;
  const size_t begin = index == 0 ? 0 : cut_.ends[index - 1];
  const std::span<const uint32_t> before = std::span(cut_.order).first(begin);
  const std::span<const uint32_t> columns = std::span(cut_.order).subspan(begin, cut_.ends[index] - begin);
  const auto count = static_cast<int64_t>(columns.size());
  std::vector<float> offset;
  std::vector<float> step;
  for (const uint32_t coefficient : columns) {
    offset.push_back(table.offset[coefficient]);
    step.push_back(table.step[coefficient]);
  }
  container.sections.push_back(Compressed(MakeSection<uint32_t>("coefficients", {count}, columns)));
  container.sections.push_back(
      Compressed(MakeSection<float>("offset", {count}, std::span<const float>(offset))));
  container.sections.push_back(Compressed(MakeSection<float>("step", {count}, std::span<const float>(step))));
  AddEntries(columns, before, container);
  Section codes;
  codes.name = absl::StrCat("btfels.", index);
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

void TileSetCutter::AddLayer(size_t index, Container& container) const {
  std::vector<uint32_t> before;
  for (size_t i = 0; i < index; ++i) {
    const std::vector<uint32_t>& held = cut_.layers->layers[i].coefficients;
    before.insert(before.end(), held.begin(), held.end());
  }
  AddLayerSections(*cut_.layers, index, cut_.tiles, tile_set_->tile_codes.size(), container);
  AddEntries(cut_.layers->layers[index].coefficients, before, container);
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
  if (cut_.layers == nullptr) {
    AddColumns(index, container);
  } else {
    AddLayer(index, container);
  }
  return SerializeContainer(std::move(container));
}

}  // namespace tessera
