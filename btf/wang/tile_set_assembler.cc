// The reading half of tile_set_parts.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <type_traits>

#include <absl/strings/str_cat.h>

#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "btf/codec/btfel_table_io.h"
#include "btf/codec/container.h"
#include "btf/codec/container_frame.h"
#include "btf/codec/decoder.h"
#include "btf/codec/quantize.h"
#include "btf/wang/arrangement_header.h"
#include "btf/wang/tile_set_index_io.h"
#include "btf/wang/tile_set_layer_io.h"
#include "btf/wang/tile_set_parts.h"
#include "btf/wang/tile_set_parts_layout.h"

namespace tessera {
namespace {

constexpr char kPartKey[] = "part";
constexpr int kMostTexelsOfSide = 4096;
constexpr float kMostValue = 1e30F;
constexpr int kMostParts = 1 << 20;
constexpr int64_t kMostCoefficients = int64_t{1} << 20;

// Reads the entries of a table from the section of its name.
absl::Status ReadEntries(const Container& container, const std::string& name,
                         std::span<const int64_t> entries, CodecTable& table) {
  if (entries.empty()) {
    return absl::OkStatus();
  }
  const std::array<int64_t, 1> shape = {static_cast<int64_t>(entries.size())};
  TESSERA_ASSIGN_OR_RETURN(const Section* section, RequireSection(container, name, table.dtype, shape));
  const auto scatter = [&]<typename T>(std::vector<T> values) {
    if constexpr (std::is_integral_v<T>) {
      std::partial_sum(values.begin(), values.end(), values.begin());
    }
    for (size_t i = 0; i < entries.size(); ++i) {
      table.values[static_cast<size_t>(entries[i])] = static_cast<float>(values[i]);
    }
  };
  switch (table.dtype) {
    case DType::kU8:
      scatter(SectionValues<uint8_t>(*section));
      return absl::OkStatus();
    case DType::kU16:
      scatter(SectionValues<uint16_t>(*section));
      return absl::OkStatus();
    default:
      break;
  }
  const std::vector<float> values = SectionValues<float>(*section);
  if (!AllFiniteValues(values)) {
    return absl::InvalidArgumentError(absl::StrCat("section '", name, "': a value is not finite"));
  }
  scatter(values);
  return absl::OkStatus();
}

absl::StatusOr<CodecTable> EmptyTable(const std::string& name, const nlohmann::json& declared) {
  CodecTable table;
  int64_t size = 1;
  const auto refused = [&name](std::string_view what) {
    return absl::InvalidArgumentError(
        absl::StrCat("header: codec table '", name, "': ", absl::string_view(what.data(), what.size())));
  };
  if (!declared.is_object() || !declared.contains("shape") || !declared.at("shape").is_array() ||
      declared.at("shape").size() > 8 || !declared.contains("dtype") || !declared.at("dtype").is_string()) {
    return refused("expected a shape and a dtype");
  }
  for (const nlohmann::json& extent : declared.at("shape")) {
    if (!extent.is_number_integer() || extent.get<int64_t>() < 0 ||
        __builtin_mul_overflow(size, extent.get<int64_t>(), &size) ||
        std::cmp_greater(size, kMaxExpandedBytes / sizeof(float))) {
      return refused(absl::StrCat("an extent is no whole number from 0, or there are more than ",
                                  kMaxExpandedBytes, " bytes"));
    }
    table.shape.push_back(extent.get<int64_t>());
  }
  const std::string dtype = declared.at("dtype").get<std::string>();
  for (const DType known : {DType::kU8, DType::kU16, DType::kF32}) {
    if (dtype == DTypeName(known)) {
      table.dtype = known;
      table.values.assign(static_cast<size_t>(size), 0.0F);
      return table;
    }
  }
  return refused("dtype is none of u8, u16 and f32");
}

absl::StatusOr<Container> ParsePart(std::span<const std::byte> bytes) {
  TESSERA_ASSIGN_OR_RETURN(Container container, ParseFrame(bytes));
  TESSERA_RETURN_IF_ERROR(RequireKind(container, kTileSetPartKind));
  return container;
}

}  // namespace

absl::StatusOr<TileSetAssembler> TileSetAssembler::Begin(std::span<const std::byte> part) {
  TESSERA_ASSIGN_OR_RETURN(const Container container, ParsePart(part));
  TESSERA_ASSIGN_OR_RETURN(const int index, ReadInteger(container.header, "part", 0, kMostParts));
  if (index != 0) {
    return absl::FailedPreconditionError(absl::StrCat("part ", index, " of a tile set, expected part 0"));
  }
  TileSetAssembler assembler;
  assembler.first_sha256_ = Sha256Hex(part);
  TESSERA_ASSIGN_OR_RETURN(const int parts, ReadInteger(container.header, "parts", 1, kMostParts));
  assembler.parts_ = static_cast<size_t>(parts);
  TESSERA_RETURN_IF_ERROR(assembler.ReadHead(container));
  TESSERA_RETURN_IF_ERROR(assembler.AddPart(container));
  // Whoever saves or draws the set meets the checks of every tile set here.
  TESSERA_RETURN_IF_ERROR(CheckTileSet(assembler.tile_set()));
  return assembler;
}

absl::Status TileSetAssembler::ReadHead(const Container& container) {
  const nlohmann::json& header = container.header;
  TESSERA_ASSIGN_OR_RETURN(ArrangementName arrangement, ReadArrangementName(header));
  tile_set_.arrangement_id = std::move(arrangement.id);
  tile_set_.arrangement_sha256 = std::move(arrangement.sha256);
  TESSERA_ASSIGN_OR_RETURN(tile_set_.strip_height, ReadInteger(header, "strip_height", 1, kMostTexelsOfSide));
  TESSERA_ASSIGN_OR_RETURN(tile_set_.radiometry, HeaderString(header, "radiometry"));
  TESSERA_ASSIGN_OR_RETURN(tile_set_.provenance, ReadProvenance(container));
  TESSERA_ASSIGN_OR_RETURN(origin_, ReadObject(header, "origin"));
  TESSERA_RETURN_IF_ERROR(ReadTables(header, container));
  return ReadTiles(container);
}

absl::Status TileSetAssembler::ReadTables(const nlohmann::json& header, const Container& container) {
  BtfelTable& table = tile_set_.btfels;
  TESSERA_ASSIGN_OR_RETURN(const nlohmann::json codec, ReadObject(header, "codec"));
  TESSERA_ASSIGN_OR_RETURN(table.codec_id, HeaderString(codec, "id"));
  TESSERA_ASSIGN_OR_RETURN(table.codec_version,
                           ReadInteger(codec, "version", 0, std::numeric_limits<int>::max()));
  TESSERA_ASSIGN_OR_RETURN(table.parameters, ReadObject(codec, "parameters"));
  TESSERA_ASSIGN_OR_RETURN(table.offset, ReadVector<float>(container, "fill"));
  if (table.offset.empty() || std::cmp_greater(table.offset.size(), kMostCoefficients) ||
      !AllFiniteValues(table.offset)) {
    return absl::InvalidArgumentError(absl::StrCat("section 'fill': ", table.offset.size(),
                                                   " values, expected 1 to ", kMostCoefficients,
                                                   " finite ones"));
  }
  table.num_coefficients = static_cast<int>(table.offset.size());
  table.step.assign(table.offset.size(), 0.0F);
  is_held_.assign(table.offset.size(), false);
  TESSERA_ASSIGN_OR_RETURN(table.views, ReadDirections("views", container));
  TESSERA_ASSIGN_OR_RETURN(table.lights, ReadDirections("lights", container));
  TESSERA_ASSIGN_OR_RETURN(const nlohmann::json tables, ReadObject(codec, "tables"));
  uint64_t table_bytes = 0;
  for (const auto& [name, declared] : tables.items()) {
    TESSERA_ASSIGN_OR_RETURN(CodecTable empty, EmptyTable(name, declared));
    table_bytes += empty.values.size() * sizeof(float);
    if (table_bytes > kMaxExpandedBytes) {
      return absl::InvalidArgumentError(
          absl::StrCat("codec tables of ", table_bytes, " bytes, at most ", kMaxExpandedBytes));
    }
    table.tables[name] = std::move(empty);
  }
  TESSERA_ASSIGN_OR_RETURN(tables_, CoefficientTables::Of(table));
  for (auto& [name, codec_table] : table.tables) {
    if (!tables_->IsSplit(name)) {
      std::vector<int64_t> all(codec_table.values.size());
      std::iota(all.begin(), all.end(), int64_t{0});
      TESSERA_RETURN_IF_ERROR(ReadEntries(container, name, all, codec_table));
    }
  }
  return absl::OkStatus();
}

absl::Status TileSetAssembler::ReadTiles(const Container& container) {
  TESSERA_ASSIGN_OR_RETURN(tile_set_.tile_codes, ReadVector<uint32_t>(container, "tile_codes"));
  const size_t all_tiles = tile_set_.tile_codes.size();
  if (container.Find("tiles") != nullptr) {
    TESSERA_ASSIGN_OR_RETURN(tiles_, ReadVector<uint32_t>(container, "tiles"));
    if (tiles_.empty() || tiles_.back() >= all_tiles ||
        std::ranges::adjacent_find(tiles_, std::greater_equal()) != tiles_.end()) {
      return absl::InvalidArgumentError(
          absl::StrCat("section 'tiles': empty, or not strictly ascending below ", all_tiles));
    }
  }
  const size_t num_tiles = tiles_.empty() ? all_tiles : tiles_.size();
  TESSERA_ASSIGN_OR_RETURN(const int w, ReadInteger(container.header, "tile_size", 1, kMostTexelsOfSide));
  TESSERA_ASSIGN_OR_RETURN(grid_.width, ReadInteger(container.header, "exemplar_width", 1, kMostGridWidth));
  TESSERA_ASSIGN_OR_RETURN(grid_.footprint, ReadInteger(container.header, "footprint", 1, kMostGridWidth));
  const size_t texels = static_cast<size_t>(w) * static_cast<size_t>(w);
  if (all_tiles > kMaxExpandedBytes / sizeof(uint32_t) / texels) {
    return absl::InvalidArgumentError(absl::StrCat("section 'tile_codes': ", all_tiles, " tiles of ", w, "x",
                                                   w, " texels take more than ", kMaxExpandedBytes,
                                                   " bytes"));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint32_t> index,
                           ReadIndexSections(container, num_tiles, w, grid_));
  // BTFels are numbered by their rank among the labels that occur.
  std::vector<uint32_t> labels(index.size());
  std::ranges::transform(index, labels.begin(), &BtfelOfTexel);
  std::ranges::sort(labels);
  labels.erase(std::ranges::unique(labels).begin(), labels.end());
  num_btfels_ = labels.size();
  if (labels.empty()) {
    return absl::InvalidArgumentError("section 'tile_codes': no tiles");
  }
  const auto k = static_cast<size_t>(tile_set_.btfels.num_coefficients);
  if (num_btfels_ > kMaxExpandedBytes / k) {
    return absl::InvalidArgumentError(absl::StrCat(
        num_btfels_, " BTFels of ", k, " coefficients take more than ", kMaxExpandedBytes, " bytes"));
  }
  std::vector<uint32_t> rank(static_cast<size_t>(labels.empty() ? 0 : labels.back()) + 1);
  for (size_t i = 0; i < labels.size(); ++i) {
    rank[labels[i]] = static_cast<uint32_t>(i);
  }
  tile_set_.tile_size = w;
  tile_set_.tile_index.assign(all_tiles * texels, 0);
  size_t from = 0;
  ForTiles(tiles_, all_tiles, [&](size_t tile) {
    for (size_t i = 0; i < texels; ++i, ++from) {
      tile_set_.tile_index[tile * texels + i] =
          PackTexel(rank[BtfelOfTexel(index[from])], TurnsOfTexel(index[from]));
    }
  });
  TESSERA_ASSIGN_OR_RETURN(const std::string labels_are, HeaderString(container.header, "labels"));
  if (labels_are == kPixelLabels) {
    tile_set_.source_pixels = labels;
    tile_set_.metadata["exemplar"] = {{"width", grid_.width}, {"footprint", grid_.footprint}};
  }
  labels_ = std::move(labels);
  tile_set_.btfels.codes.assign(num_btfels_ * k, 0);
  return absl::OkStatus();
}

absl::Status TileSetAssembler::BeginLayers(const Container& container) {
  const BtfelTable& table = tile_set_.btfels;
  TESSERA_ASSIGN_OR_RETURN(TileSetLayers shared,
                           ReadSharedSections(container, static_cast<size_t>(table.num_coefficients),
                                              table.views.size(), table.lights.size()));
  TESSERA_RETURN_IF_ERROR(CheckNew(shared.coefficients, held_));
  if (shared.bases.has_value()) {
    if (!held_.empty()) {
      return absl::InvalidArgumentError("section 'core_mean': tables came as they are before");
    }
    TESSERA_ASSIGN_OR_RETURN(
        cores_, CoreSum::Create(table, AngularTablesOf(table, *tables_), *std::move(shared.bases)));
  }
  layers_.emplace(BlocksOf(labels_, grid_, shared.block_side, shared.level), std::move(shared.coefficients),
                  std::move(shared.mean), std::move(shared.scale));
  return absl::OkStatus();
}

absl::Status TileSetAssembler::CheckNew(std::span<const uint32_t> coefficients,
                                        std::span<const uint32_t> before) const {
  const auto k = static_cast<size_t>(tile_set_.btfels.num_coefficients);
  std::vector<bool> taken(k, false);
  for (const uint32_t coefficient : before) {
    taken[coefficient] = true;
  }
  for (const uint32_t coefficient : coefficients) {
    if (coefficient >= k || taken[coefficient]) {
      return absl::InvalidArgumentError(absl::StrCat("section 'coefficients': ", coefficient, " of ", k,
                                                     " is out of range or came before"));
    }
    taken[coefficient] = true;
  }
  return absl::OkStatus();
}

absl::Status TileSetAssembler::AddPart(const Container& container) {
  if (HasLayer(container)) {
    TESSERA_RETURN_IF_ERROR(AddLayer(container));
  } else {
    Quantize();
    TESSERA_RETURN_IF_ERROR(AddColumns(container));
  }
  ++num_parts_;
  Record();
  return absl::OkStatus();
}

absl::StatusOr<BtfelTable> TileSetAssembler::TablesWith(std::span<const uint32_t> coefficients,
                                                        const Container& container) const {
  BtfelTable shared = tile_set_.btfels.WithoutCodes();
  for (auto& [name, codec_table] : shared.tables) {
    if (tables_->IsSplit(name) && !IsCored(name)) {
      TESSERA_RETURN_IF_ERROR(
          ReadEntries(container, name, tables_->EntriesOf(name, coefficients, held_), codec_table));
    }
  }
  return shared;
}

bool TileSetAssembler::IsCored(const std::string& table) const {
  return cores_.has_value() &&
         std::ranges::find(cores_->tables(), table, &AngularTable::name) != cores_->tables().end();
}

absl::Status TileSetAssembler::AddColumns(const Container& container) {
  const auto k = static_cast<size_t>(tile_set_.btfels.num_coefficients);
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint32_t> columns,
                           ReadVector<uint32_t>(container, "coefficients"));
  TESSERA_RETURN_IF_ERROR(CheckNew(columns, exact_));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<float> offset, ReadFinite(container, "offset", columns.size()));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<float> step, ReadFinite(container, "step", columns.size()));
  if (columns.empty() || std::ranges::any_of(step, [](float s) { return s < 0.0F; })) {
    return absl::InvalidArgumentError("section 'step': no values, or a negative one");
  }
  const std::array<int64_t, 2> shape = {static_cast<int64_t>(num_btfels_),
                                        static_cast<int64_t>(columns.size())};
  TESSERA_ASSIGN_OR_RETURN(const Section* codes,
                           RequireSection(container, absl::StrCat("btfels.", num_parts_), DType::kU8, shape));
  // Everything but the codes is tried on a copy first.
  TESSERA_ASSIGN_OR_RETURN(BtfelTable shared, TablesWith(columns, container));
  for (size_t i = 0; i < columns.size(); ++i) {
    shared.offset[columns[i]] = offset[i];
    shared.step[columns[i]] = step[i];
  }
  TESSERA_RETURN_IF_ERROR(MakeDecoder(shared).status());

  shared.codes = std::move(tile_set_.btfels.codes);
  tile_set_.btfels = std::move(shared);
  const char* from = codes->bytes.data();
  for (size_t btfel = 0; btfel < num_btfels_; ++btfel) {
    uint8_t* const to = tile_set_.btfels.codes.data() + btfel * k;
    for (const uint32_t coefficient : columns) {
      to[coefficient] = static_cast<uint8_t>(*from++);
    }
  }
  exact_.insert(exact_.end(), columns.begin(), columns.end());
  Hold(columns);
  return absl::OkStatus();
}

void TileSetAssembler::Hold(std::span<const uint32_t> coefficients) {
  for (const uint32_t coefficient : coefficients) {
    if (!is_held_[coefficient]) {
      is_held_[coefficient] = true;
      held_.push_back(coefficient);
    }
  }
}

absl::Status TileSetAssembler::AddLayer(const Container& container) {
  const bool is_first = !layers_.has_value();
  if (is_first) {
    TESSERA_RETURN_IF_ERROR(BeginLayers(container));
  }
  const absl::Status added = SumLayer(container, is_first);
  if (!added.ok() && is_first) {
    layers_.reset();
    cores_.reset();
  }
  return added;
}

absl::Status TileSetAssembler::SumLayer(const Container& container, bool is_first) {
  TESSERA_ASSIGN_OR_RETURN(
      const TileSetLayer layer,
      ReadLayerSections(container, *layers_, cores_.has_value() ? cores_->num_matrices() : 0));
  const std::vector<uint32_t> coefficients =
      is_first ? std::vector<uint32_t>(layers_->coefficients().begin(), layers_->coefficients().end())
               : std::vector<uint32_t>();
  TESSERA_ASSIGN_OR_RETURN(BtfelTable shared, TablesWith(coefficients, container));
  LayerSum sum = *layers_;
  TESSERA_RETURN_IF_ERROR(sum.Add(layer));
  if (!(sum.Bound() <= kMostValue)) {
    return absl::InvalidArgumentError(
        absl::StrCat("layers: coefficients up to ", sum.Bound(), ", at most ", kMostValue));
  }
  std::optional<CoreSum> cores = cores_;
  if (cores.has_value() && (is_first || !layer.cores.empty())) {
    if (!layer.cores.empty()) {
      TESSERA_RETURN_IF_ERROR(cores->Add(layer.core_step, layer.cores));
    }
    cores->Write(shared.tables);
  } else if (!layer.cores.empty()) {
    return absl::InvalidArgumentError("section 'cores': the first layer has no bases for them");
  }
  TESSERA_RETURN_IF_ERROR(MakeDecoder(shared).status());
  shared.codes = std::move(tile_set_.btfels.codes);
  tile_set_.btfels = std::move(shared);
  layers_ = std::move(sum);
  cores_ = std::move(cores);
  is_stale_ = true;
  Hold(coefficients);
  return absl::OkStatus();
}

void TileSetAssembler::Quantize() {
  constexpr size_t kRows = 128;  // their values stay in the processor's cache
  if (!is_stale_) {
    return;
  }
  is_stale_ = false;
  BtfelTable& table = tile_set_.btfels;
  const auto k = static_cast<size_t>(table.num_coefficients);
  const auto for_rows = [&](const auto& body) {
    for (size_t begin = 0; begin < num_btfels_; begin += kRows) {
      std::vector<uint32_t> btfels(std::min(kRows, num_btfels_ - begin));
      std::iota(btfels.begin(), btfels.end(), static_cast<uint32_t>(begin));
      body(begin, layers_->Coefficients(btfels));
    }
  };
  std::vector<float> low(k, INFINITY);
  std::vector<float> high(k, -INFINITY);
  for_rows([&](size_t, const std::vector<float>& values) {
    for (size_t row = 0; row < values.size(); row += k) {
      for (size_t i = 0; i < k; ++i) {
        low[i] = std::min(low[i], values[row + i]);
        high[i] = std::max(high[i], values[row + i]);
      }
    }
  });
  Quantisation quantisation = UniformQuantisation(low, high);
  for (const uint32_t coefficient : exact_) {
    quantisation.offset[coefficient] = table.offset[coefficient];
    quantisation.step[coefficient] = table.step[coefficient];
  }
  std::vector<uint8_t> codes(kRows * k);
  for_rows([&](size_t begin, const std::vector<float>& values) {
    tessera::Quantize(quantisation, values, std::span(codes).first(values.size()));
    uint8_t* const to = table.codes.data() + begin * k;
    for (size_t row = 0; row < values.size(); row += k) {
      for (const uint32_t coefficient : exact_) {
        codes[row + coefficient] = to[row + coefficient];
      }
    }
    std::copy_n(codes.begin(), values.size(), to);
  });
  table.offset = std::move(quantisation.offset);
  table.step = std::move(quantisation.step);
}

absl::Status TileSetAssembler::Add(std::span<const std::byte> part) {
  TESSERA_ASSIGN_OR_RETURN(const Container container, ParsePart(part));
  TESSERA_ASSIGN_OR_RETURN(const int index, ReadInteger(container.header, "part", 0, kMostParts));
  TESSERA_ASSIGN_OR_RETURN(const std::string first, HeaderString(container.header, "first_sha256"));
  if (std::cmp_not_equal(index, num_parts_) || first != first_sha256_) {
    return absl::FailedPreconditionError(absl::StrCat("part ", index, " of the tile set that begins with ",
                                                      first.substr(0, 64), ", expected part ", num_parts_,
                                                      " of ", first_sha256_));
  }
  return AddPart(container);
}

void TileSetAssembler::Record() {
  nlohmann::json record = origin_;
  if (!tiles_.empty()) {
    record["tiles"] = tiles_;
  }
  record["num_coefficients"] = held_.size();
  tile_set_.metadata[kPartKey] = std::move(record);
}

std::optional<std::vector<uint32_t>> TilesHeld(const TileSet& tile_set) {
  const auto part = tile_set.metadata.find(kPartKey);
  if (part == tile_set.metadata.end() || !part->is_object() || !part->contains("tiles") ||
      !part->at("tiles").is_array()) {
    return std::nullopt;
  }
  std::vector<uint32_t> tiles;
  for (const nlohmann::json& tile : part->at("tiles")) {
    if (tile.is_number_unsigned()) {
      tiles.push_back(static_cast<uint32_t>(tile.get<uint64_t>()));
    }
  }
  return tiles;
}

}  // namespace tessera
