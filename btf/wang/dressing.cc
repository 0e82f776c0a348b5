#include "btf/wang/dressing.h"

#include <array>
#include <cstring>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/container.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/arrangement_header.h"

namespace tessera {
namespace {

constexpr char kKind[] = "dressing";
constexpr char kProducer[] = "tessera";

// Flat arrays of fixed-size rows, as numpy sees them.
template <typename T, typename Row>
Section RowsSection(std::string name, const std::vector<Row>& rows) {
  constexpr size_t kColumns = sizeof(Row) / sizeof(T);
  Section section;
  section.name = std::move(name);
  section.dtype = DTypeOf<T>::value;
  section.shape = {static_cast<int64_t>(rows.size()), static_cast<int64_t>(kColumns)};
  section.bytes.resize(rows.size() * sizeof(Row));
  if (!rows.empty()) {
    std::memcpy(section.bytes.data(), rows.data(), section.bytes.size());
  }
  return section;
}

template <typename T, typename Row>
absl::StatusOr<std::vector<Row>> ReadRows(const Container& container, std::string_view name,
                                          int64_t num_rows) {
  constexpr int64_t kColumns = sizeof(Row) / sizeof(T);
  TESSERA_ASSIGN_OR_RETURN(
      const Section* section,
      RequireSection(container, name, DTypeOf<T>::value, std::array<int64_t, 2>{num_rows, kColumns}));
  std::vector<Row> rows(section->bytes.size() / sizeof(Row));
  if (!rows.empty()) {
    std::memcpy(static_cast<void*>(rows.data()), section->bytes.data(), section->bytes.size());
  }
  return rows;
}

absl::Status CheckDressing(const Dressing& dressing) {
  TESSERA_RETURN_IF_ERROR(ValidateQuadMesh(dressing.mesh));
  TESSERA_RETURN_IF_ERROR(CheckArrangementName({dressing.arrangement_id, dressing.arrangement_sha256}));
  const size_t num_quads = dressing.mesh.quads.size();
  if (dressing.tile.size() != num_quads || dressing.turns.size() != num_quads) {
    return absl::InvalidArgumentError(absl::StrCat("the dressing has ", dressing.tile.size(), " tiles and ",
                                                   dressing.turns.size(), " turns for ", num_quads,
                                                   " quads"));
  }
  const auto known = FindArrangement(dressing.arrangement_id);
  for (size_t quad = 0; quad < num_quads; ++quad) {
    if (known.ok() && dressing.tile[quad] >= (*known)->codes.size()) {
      return absl::InvalidArgumentError(absl::StrCat("quad ", quad + 1, ": tile ", dressing.tile[quad],
                                                     " does not exist; ", dressing.arrangement_id, " has ",
                                                     (*known)->codes.size()));
    }
    if (dressing.turns[quad] > 3) {
      return absl::InvalidArgumentError(
          absl::StrCat("quad ", quad + 1, ": ", dressing.turns[quad], " turns, expected 0..3"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> SerializeDressing(const Dressing& dressing) {
  TESSERA_RETURN_IF_ERROR(CheckDressing(dressing));
  Container container;
  container.kind = kKind;
  container.header = dressing.other_keys;
  container.header["producer"] = kProducer;
  container.header["arrangement"] = {{"id", dressing.arrangement_id},
                                     {"sha256", dressing.arrangement_sha256}};
  container.header["seed"] = dressing.seed;
  container.header["source_mesh_sha256"] = dressing.source_mesh_sha256;
  container.header["metadata"] = dressing.metadata;
  const auto num_quads = static_cast<int64_t>(dressing.mesh.quads.size());
  container.sections.push_back(RowsSection<float>("positions", dressing.mesh.positions));
  container.sections.push_back(RowsSection<float>("normals", dressing.mesh.normals));
  container.sections.push_back(RowsSection<uint32_t>("quads", dressing.mesh.quads));
  container.sections.push_back(
      MakeSection<uint32_t>("tile", {num_quads}, std::span<const uint32_t>(dressing.tile)));
  container.sections.push_back(
      MakeSection<uint8_t>("turns", {num_quads}, std::span<const uint8_t>(dressing.turns)));
  return SerializeContainer(std::move(container));
}

absl::StatusOr<Dressing> ParseDressing(std::span<const std::byte> bytes) {
  TESSERA_ASSIGN_OR_RETURN(Container container, ParseContainerOfKind(bytes, kKind));
  Dressing dressing;
  TESSERA_ASSIGN_OR_RETURN(ArrangementName arrangement, ReadArrangementName(container.header));
  dressing.arrangement_id = std::move(arrangement.id);
  dressing.arrangement_sha256 = std::move(arrangement.sha256);
  const auto seed = container.header.find("seed");
  if (seed == container.header.end() || !seed->is_number_unsigned()) {
    return absl::InvalidArgumentError("header: 'seed' is missing or no unsigned integer");
  }
  dressing.seed = seed->get<uint64_t>();
  TESSERA_ASSIGN_OR_RETURN(dressing.source_mesh_sha256, HeaderString(container.header, "source_mesh_sha256"));
  TESSERA_ASSIGN_OR_RETURN(dressing.metadata, ReadObject(container.header, "metadata"));

  TESSERA_ASSIGN_OR_RETURN(dressing.mesh.positions,
                           (ReadRows<float, Eigen::Vector3f>(container, "positions", -1)));
  const auto num_vertices = static_cast<int64_t>(dressing.mesh.positions.size());
  TESSERA_ASSIGN_OR_RETURN(dressing.mesh.normals,
                           (ReadRows<float, Eigen::Vector3f>(container, "normals", num_vertices)));
  TESSERA_ASSIGN_OR_RETURN(dressing.mesh.quads, (ReadRows<uint32_t, Quad>(container, "quads", -1)));
  const std::array<int64_t, 1> per_quad{static_cast<int64_t>(dressing.mesh.quads.size())};
  TESSERA_ASSIGN_OR_RETURN(const Section* tile, RequireSection(container, "tile", DType::kU32, per_quad));
  dressing.tile = SectionValues<uint32_t>(*tile);
  TESSERA_ASSIGN_OR_RETURN(const Section* turns, RequireSection(container, "turns", DType::kU8, per_quad));
  dressing.turns = SectionValues<uint8_t>(*turns);
  TESSERA_RETURN_IF_ERROR(CheckDressing(dressing));
  dressing.other_keys = OtherKeys(std::move(container.header),
                                  {"producer", "arrangement", "seed", "source_mesh_sha256", "metadata"});
  return dressing;
}

}  // namespace tessera
