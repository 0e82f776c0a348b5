#include "btf/wang/tile_set.h"

#include <algorithm>
#include <array>
#include <functional>
#include <numeric>
#include <optional>

#include <absl/strings/str_cat.h>

#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "btf/codec/btfel_table_io.h"
#include "btf/codec/container.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/arrangement_header.h"

namespace tessera {
namespace {

constexpr char kKind[] = "tile_set";
constexpr char kProducer[] = "tessera";
constexpr int kMaxTileSize = 4096;

// The digest names the very list of codes, known here or not.
absl::Status CheckCodes(const TileSet& tile_set) {
  if (tile_set.tile_codes.empty() ||
      std::adjacent_find(tile_set.tile_codes.begin(), tile_set.tile_codes.end(),
                         [](uint32_t a, uint32_t b) { return a >= b; }) != tile_set.tile_codes.end()) {
    return absl::InvalidArgumentError("section 'tile_codes': empty or not strictly ascending");
  }
  Arrangement listed;
  listed.id = tile_set.arrangement_id;
  listed.codes = tile_set.tile_codes;
  const std::string listing = ArrangementListing(listed);
  const std::string digest = Sha256Hex(std::as_bytes(std::span(listing)));
  if (digest != tile_set.arrangement_sha256) {
    return absl::FailedPreconditionError(
        absl::StrCat("arrangement ", tile_set.arrangement_id, ": sha256 ", tile_set.arrangement_sha256,
                     ", but the ", tile_set.tile_codes.size(), " tile codes have ", digest));
  }
  return absl::OkStatus();
}

absl::Status CheckTiles(const TileSet& tile_set) {
  const auto w = static_cast<size_t>(tile_set.tile_size);
  const size_t texels = tile_set.tile_codes.size() * w * w;
  if (tile_set.tile_index.size() != texels) {
    return absl::InvalidArgumentError(absl::StrCat("section 'tile_index': ", tile_set.tile_index.size(),
                                                   " texels, expected ", tile_set.tile_codes.size(),
                                                   " tiles of ", w, "x", w));
  }
  const size_t num_btfels = tile_set.btfels.size();
  for (size_t i = 0; i < texels; ++i) {
    if (BtfelOfTexel(tile_set.tile_index[i]) >= num_btfels) {
      return absl::InvalidArgumentError(
          absl::StrCat("section 'tile_index': tile ", i / (w * w), ", texel (", i % w, ", ", i / w % w,
                       ") names BTFel ", BtfelOfTexel(tile_set.tile_index[i]), "; there are ", num_btfels));
    }
  }
  if (!tile_set.seam_heat.empty() && tile_set.seam_heat.size() != texels) {
    return absl::InvalidArgumentError(absl::StrCat("section 'seam_heat': ", tile_set.seam_heat.size(),
                                                   " texels, 'tile_index' has ", texels));
  }
  const std::vector<uint32_t>& sources = tile_set.source_pixels;
  if (!sources.empty() && (sources.size() != num_btfels ||
                           std::ranges::adjacent_find(sources, std::greater_equal()) != sources.end())) {
    return absl::InvalidArgumentError(absl::StrCat("section 'source_pixels': ", sources.size(),
                                                   " pixels for ", num_btfels,
                                                   " BTFels, or not strictly ascending"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckTileSet(const TileSet& tile_set) {
  TESSERA_RETURN_IF_ERROR(CheckArrangementName({tile_set.arrangement_id, tile_set.arrangement_sha256}));
  if (tile_set.tile_size < 1 || tile_set.tile_size > kMaxTileSize) {
    return absl::InvalidArgumentError(
        absl::StrCat("tile size ", tile_set.tile_size, ", expected 1 to ", kMaxTileSize));
  }
  if (tile_set.strip_height < 1 || tile_set.strip_height > tile_set.tile_size) {
    return absl::InvalidArgumentError(absl::StrCat("strip height ", tile_set.strip_height,
                                                   ", expected 1 to the tile size, ", tile_set.tile_size));
  }
  TESSERA_RETURN_IF_ERROR(CheckCodes(tile_set));
  return CheckTiles(tile_set);
}

std::optional<SourceGrid> SourceGridOf(const TileSet& tile_set) {
  const auto exemplar = tile_set.metadata.find("exemplar");
  const std::vector<uint32_t>& pixels = tile_set.source_pixels;
  if (pixels.empty() || pixels.size() != tile_set.btfels.size() || pixels.back() > kLargestPackedBtfel ||
      exemplar == tile_set.metadata.end() || !exemplar->is_object()) {
    return std::nullopt;
  }
  const auto read = [&exemplar](const char* key, int64_t fallback) {
    const auto value = exemplar->find(key);
    return value != exemplar->end() && value->is_number_integer() ? value->get<int64_t>() : fallback;
  };
  const int64_t width = read("width", 0);
  const int64_t footprint = read("footprint", 1);
  if (width < 1 || width > kMostGridWidth || footprint < 1 || footprint > kMostGridWidth) {
    return std::nullopt;
  }
  return SourceGrid{.width = static_cast<int>(width), .footprint = static_cast<int>(footprint)};
}

BtfelLabels LabelsOf(const TileSet& tile_set) {
  if (const std::optional<SourceGrid> grid = SourceGridOf(tile_set)) {
    return {.pixels = tile_set.source_pixels, .grid = *grid, .are_pixels = true};
  }
  BtfelLabels labels;
  labels.pixels.resize(tile_set.btfels.size());
  std::iota(labels.pixels.begin(), labels.pixels.end(), 0U);
  return labels;
}

absl::StatusOr<std::string> SerializeTileSet(const TileSet& tile_set) {
  TESSERA_RETURN_IF_ERROR(CheckTileSet(tile_set));
  Container container;
  container.kind = kKind;
  container.header = tile_set.other_keys;
  container.header["producer"] = kProducer;
  container.header["arrangement"] = {{"id", tile_set.arrangement_id},
                                     {"sha256", tile_set.arrangement_sha256}};
  container.header["strip_height"] = tile_set.strip_height;
  container.header["radiometry"] = tile_set.radiometry;
  container.header["certificate"] = tile_set.certificate;
  container.header["metadata"] = tile_set.metadata;
  AddProvenance(tile_set.provenance, container);
  const auto tiles = static_cast<int64_t>(tile_set.tile_codes.size());
  // The small sections come first, so that a prefix of the file that ends after some `btfels` is a coarser
  // set.
  container.sections.push_back(
      MakeSection<uint32_t>("tile_codes", {tiles}, std::span<const uint32_t>(tile_set.tile_codes)));
  container.sections.push_back(MakeSection<uint32_t>("tile_index",
                                                     {tiles, tile_set.tile_size, tile_set.tile_size},
                                                     std::span<const uint32_t>(tile_set.tile_index)));
  if (!tile_set.source_pixels.empty()) {
    container.sections.push_back(MakeSection<uint32_t>(
        "source_pixels", {static_cast<int64_t>(tile_set.source_pixels.size())}, tile_set.source_pixels));
  }
  if (!tile_set.seam_heat.empty()) {
    container.sections.push_back(MakeSection<uint8_t>(
        "seam_heat", {tiles, tile_set.tile_size, tile_set.tile_size}, tile_set.seam_heat));
  }
  TESSERA_RETURN_IF_ERROR(AddSharedTables(tile_set.btfels, container));
  TESSERA_RETURN_IF_ERROR(AddCoefficientsByEnergy(tile_set.btfels, container));
  return SerializeContainer(std::move(container));
}

absl::StatusOr<TileSet> ParseTileSet(std::span<const std::byte> bytes) {
  TESSERA_ASSIGN_OR_RETURN(Container container, ParseContainerOfKind(bytes, kKind));
  TileSet tile_set;
  TESSERA_ASSIGN_OR_RETURN(ArrangementName arrangement, ReadArrangementName(container.header));
  tile_set.arrangement_id = std::move(arrangement.id);
  tile_set.arrangement_sha256 = std::move(arrangement.sha256);
  TESSERA_ASSIGN_OR_RETURN(tile_set.strip_height,
                           ReadInteger(container.header, "strip_height", 1, kMaxTileSize));
  TESSERA_ASSIGN_OR_RETURN(const Section* codes,
                           RequireSection(container, "tile_codes", DType::kU32, std::array<int64_t, 1>{-1}));
  tile_set.tile_codes = SectionValues<uint32_t>(*codes);
  TESSERA_ASSIGN_OR_RETURN(
      const Section* index,
      RequireSection(container, "tile_index", DType::kU32, std::array<int64_t, 3>{codes->shape[0], -1, -1}));
  if (index->shape[1] != index->shape[2] || index->shape[1] < 1 || index->shape[1] > kMaxTileSize) {
    return absl::InvalidArgumentError(absl::StrCat("section 'tile_index': tiles of ", index->shape[2], "x",
                                                   index->shape[1], ", expected square ones of 1 to ",
                                                   kMaxTileSize));
  }
  tile_set.tile_size = static_cast<int>(index->shape[1]);
  tile_set.tile_index = SectionValues<uint32_t>(*index);
  if (container.Find("source_pixels") != nullptr) {
    TESSERA_ASSIGN_OR_RETURN(const Section* sources, RequireSection(container, "source_pixels", DType::kU32,
                                                                    std::array<int64_t, 1>{-1}));
    tile_set.source_pixels = SectionValues<uint32_t>(*sources);
  }
  if (container.Find("seam_heat") != nullptr) {
    const std::array<int64_t, 3> shape = {codes->shape[0], tile_set.tile_size, tile_set.tile_size};
    TESSERA_ASSIGN_OR_RETURN(const Section* heat, RequireSection(container, "seam_heat", DType::kU8, shape));
    tile_set.seam_heat = SectionValues<uint8_t>(*heat);
  }
  TESSERA_ASSIGN_OR_RETURN(tile_set.btfels, ReadSharedTables(container));
  TESSERA_RETURN_IF_ERROR(ReadCoefficientsByEnergy(container, tile_set.btfels));
  TESSERA_ASSIGN_OR_RETURN(tile_set.provenance, ReadProvenance(container));
  TESSERA_ASSIGN_OR_RETURN(tile_set.radiometry, HeaderString(container.header, "radiometry"));
  TESSERA_ASSIGN_OR_RETURN(tile_set.certificate, ReadObject(container.header, "certificate"));
  TESSERA_ASSIGN_OR_RETURN(tile_set.metadata, ReadObject(container.header, "metadata"));
  TESSERA_RETURN_IF_ERROR(CheckTileSet(tile_set));
  tile_set.other_keys = OtherKeys(std::move(container.header),
                                  {"producer", "source", "licence", "citation", "radiometry", "codec",
                                   "arrangement", "strip_height", "certificate", "metadata"});
  return tile_set;
}

}  // namespace tessera
