#include "btf/codec/btfel_table_io.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <string_view>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"

namespace tessera {
namespace {

constexpr std::array<std::string_view, 6> kReservedNames = {"coefficients", "offset", "step",
                                                            "views",        "lights", "btfel_order"};
constexpr int64_t kMaxCoefficients = int64_t{1} << 20;
constexpr uint64_t kInMemory = std::numeric_limits<uint64_t>::max();
// Stored directions are float32: their length is 1 and their height >= 0 only up to rounding.
constexpr double kUnitLengthTolerance = 1e-3;
constexpr double kHorizonTolerance = 1e-5;
// The shares of the coefficients at which the energy-ordered table is split.
constexpr std::array<double, 4> kSplitShares = {0.125, 0.25, 0.5, 1.0};

bool AllFinite(const std::vector<float>& values) {
  return std::ranges::all_of(values, [](float v) { return std::isfinite(v); });
}

template <typename T>
absl::StatusOr<Section> WholeNumberSection(const std::string& name, const CodecTable& table) {
  std::vector<T> values;
  values.reserve(table.values.size());
  for (const float v : table.values) {
    if (!(v >= 0.0F && v <= std::numeric_limits<T>::max()) || v != std::floor(v)) {
      return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "': value ", v,
                                                     ", expected a whole number up to ",
                                                     std::numeric_limits<T>::max()));
    }
    values.push_back(static_cast<T>(v));
  }
  return MakeSection<T>(name, table.shape, std::span<const T>(values));
}

absl::StatusOr<Section> SectionOfTable(const std::string& name, const CodecTable& table) {
  switch (table.dtype) {
    case DType::kU8:
      return WholeNumberSection<uint8_t>(name, table);
    case DType::kU16:
      return WholeNumberSection<uint16_t>(name, table);
    case DType::kF32:
      if (!AllFinite(table.values)) {
        return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "': a value is not finite"));
      }
      return MakeSection<float>(name, table.shape, std::span<const float>(table.values));
    default:
      return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "': dtype ",
                                                     std::string(DTypeName(table.dtype)),
                                                     ", expected u8, u16 or f32"));
  }
}

absl::StatusOr<CodecTable> TableOfSection(const Section& section) {
  CodecTable table{section.shape, {}, section.dtype};
  const auto take = [&table](const auto& values) { table.values.assign(values.begin(), values.end()); };
  switch (section.dtype) {
    case DType::kU8:
      take(SectionValues<uint8_t>(section));
      break;
    case DType::kU16:
      take(SectionValues<uint16_t>(section));
      break;
    case DType::kF32:
      table.values = SectionValues<float>(section);
      break;
    default:
      return absl::InvalidArgumentError(absl::StrCat("codec table '", section.name, "': dtype ",
                                                     std::string(DTypeName(section.dtype)),
                                                     ", expected u8, u16 or f32"));
  }
  if (!AllFinite(table.values)) {
    return absl::InvalidArgumentError(absl::StrCat("section '", section.name, "': a value is not finite"));
  }
  return table;
}

absl::Status CheckQuantisation(const BtfelTable& table) {
  const size_t k = static_cast<size_t>(table.num_coefficients);
  if (table.num_coefficients < 1 || table.num_coefficients > kMaxCoefficients) {
    return absl::InvalidArgumentError(
        absl::StrCat(table.num_coefficients, " coefficients a BTFel, expected 1 to ", kMaxCoefficients));
  }
  if (table.offset.size() != k || table.step.size() != k) {
    return absl::InvalidArgumentError(absl::StrCat("offset has ", table.offset.size(), " and step ",
                                                   table.step.size(), " values, expected ", k));
  }
  if (!AllFinite(table.offset)) {
    return absl::InvalidArgumentError("section 'offset': a value is not finite");
  }
  if (!AllFinite(table.step) || std::ranges::any_of(table.step, [](float s) { return s < 0.0F; })) {
    return absl::InvalidArgumentError("section 'step': a value is not finite or negative");
  }
  return absl::OkStatus();
}

std::string EnergySectionName(size_t index) {
  return absl::StrCat("btfels.", index);
}

// The coefficients in falling order of energy.
std::vector<uint32_t> EnergyOrder(const BtfelTable& table) {
  const size_t k = static_cast<size_t>(table.num_coefficients);
  // Integer sums of codes and their squares: exact, so the order is the same on every machine.
  std::vector<uint64_t> sum(k, 0);
  std::vector<uint64_t> sum_of_squares(k, 0);
  for (size_t n = 0; n < table.size(); ++n) {
    const uint8_t* codes = table.codes.data() + n * k;
    for (size_t i = 0; i < k; ++i) {
      sum[i] += codes[i];
      sum_of_squares[i] += static_cast<uint64_t>(codes[i]) * codes[i];
    }
  }
  std::vector<double> energy(k);
  for (size_t i = 0; i < k; ++i) {
    const double offset = table.offset[i];
    const double step = table.step[i];
    energy[i] = static_cast<double>(table.size()) * offset * offset +
                2.0 * offset * step * static_cast<double>(sum[i]) +
                step * step * static_cast<double>(sum_of_squares[i]);
  }
  std::vector<uint32_t> order(k);
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::stable_sort(order, [&](uint32_t a, uint32_t b) { return energy[a] > energy[b]; });
  return order;
}

}  // namespace

absl::Status AddDirections(std::string_view name, const std::vector<Direction>& directions,
                           Container& container) {
  std::vector<float> values;
  for (size_t i = 0; i < directions.size(); ++i) {
    const Eigen::Vector3d v = VectorFromDirection(directions[i]);
    if (!v.allFinite() || v.z() < -kHorizonTolerance) {
      return absl::InvalidArgumentError(absl::StrCat("section '", std::string(name), "': direction ", i,
                                                     " is not finite or points below the surface"));
    }
    for (int axis = 0; axis < 3; ++axis) {
      values.push_back(static_cast<float>(v[axis]));
    }
  }
  container.sections.push_back(MakeSection<float>(
      std::string(name), {static_cast<int64_t>(directions.size()), 3}, std::span<const float>(values)));
  return absl::OkStatus();
}

absl::StatusOr<std::vector<Direction>> ReadDirections(std::string_view name, const Container& container) {
  TESSERA_ASSIGN_OR_RETURN(const Section* section,
                           RequireSection(container, name, DType::kF32, std::array<int64_t, 2>{-1, 3}));
  const std::vector<float> values = SectionValues<float>(*section);
  if (values.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("section '", std::string(name), "': no directions"));
  }
  std::vector<Direction> directions;
  for (size_t i = 0; i < values.size(); i += 3) {
    const Eigen::Vector3d v(values[i], values[i + 1], values[i + 2]);
    if (!v.allFinite() || std::abs(v.norm() - 1.0) > kUnitLengthTolerance || v.z() < -kHorizonTolerance) {
      return absl::InvalidArgumentError(absl::StrCat("section '", std::string(name), "': direction ", i / 3,
                                                     " is not a unit vector above the surface"));
    }
    directions.push_back(DirectionFromVector(v));
  }
  return directions;
}

absl::Status AddSharedTables(const BtfelTable& table, Container& container) {
  TESSERA_RETURN_IF_ERROR(CheckQuantisation(table));
  nlohmann::json names = nlohmann::json::array();
  for (const auto& [name, codec_table] : table.tables) {
    if (std::ranges::find(kReservedNames, std::string_view(name)) != kReservedNames.end() ||
        container.Find(name) != nullptr) {
      return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "': the name is taken"));
    }
    names.push_back(name);
  }
  container.header["codec"] = {{"id", table.codec_id},
                               {"version", table.codec_version},
                               {"parameters", table.parameters},
                               {"tables", std::move(names)}};
  const int64_t k = table.num_coefficients;
  container.sections.push_back(MakeSection<float>("offset", {k}, std::span<const float>(table.offset)));
  container.sections.push_back(MakeSection<float>("step", {k}, std::span<const float>(table.step)));
  TESSERA_RETURN_IF_ERROR(AddDirections("views", table.views, container));
  TESSERA_RETURN_IF_ERROR(AddDirections("lights", table.lights, container));
  for (const auto& [name, codec_table] : table.tables) {
    TESSERA_ASSIGN_OR_RETURN(Section section, SectionOfTable(name, codec_table));
    container.sections.push_back(std::move(section));
  }
  return absl::OkStatus();
}

absl::StatusOr<BtfelTable> ReadSharedTables(const Container& container) {
  const auto codec = container.header.find("codec");
  if (codec == container.header.end() || !codec->is_object() || !codec->contains("id") ||
      !codec->at("id").is_string() || !codec->contains("version") ||
      !codec->at("version").is_number_integer()) {
    return absl::InvalidArgumentError("header: codec is not an object with a string id and a version number");
  }
  BtfelTable table;
  table.codec_id = codec->at("id").get<std::string>();
  const int64_t version = codec->at("version").get<int64_t>();
  if (version < 0 || version > std::numeric_limits<int>::max()) {
    return absl::UnimplementedError(
        absl::StrCat("codec '", table.codec_id, "' version ", codec->at("version").dump()));
  }
  table.codec_version = static_cast<int>(version);
  if (const auto parameters = codec->find("parameters"); parameters != codec->end()) {
    if (!parameters->is_object()) {
      return absl::InvalidArgumentError("header: codec parameters are not an object");
    }
    table.parameters = *parameters;
  }

  const std::array<int64_t, 1> any_vector = {-1};
  TESSERA_ASSIGN_OR_RETURN(const Section* offset,
                           RequireSection(container, "offset", DType::kF32, any_vector));
  TESSERA_ASSIGN_OR_RETURN(const Section* step,
                           RequireSection(container, "step", DType::kF32, offset->shape));
  if (offset->shape[0] > kMaxCoefficients) {
    return absl::InvalidArgumentError(
        absl::StrCat("section 'offset': ", offset->shape[0], " coefficients, at most ", kMaxCoefficients));
  }
  table.num_coefficients = static_cast<int>(offset->shape[0]);
  table.offset = SectionValues<float>(*offset);
  table.step = SectionValues<float>(*step);
  TESSERA_RETURN_IF_ERROR(CheckQuantisation(table));
  TESSERA_ASSIGN_OR_RETURN(table.views, ReadDirections("views", container));
  TESSERA_ASSIGN_OR_RETURN(table.lights, ReadDirections("lights", container));

  if (const auto names = codec->find("tables"); names != codec->end()) {
    if (!names->is_array()) {
      return absl::InvalidArgumentError("header: codec tables is not an array");
    }
    for (const nlohmann::json& name : *names) {
      const Section* section = name.is_string() ? container.Find(name.get<std::string>()) : nullptr;
      if (section == nullptr) {
        return absl::InvalidArgumentError(
            absl::StrCat("codec table ", name.dump(-1, ' ', true), ": there is no such section"));
      }
      TESSERA_ASSIGN_OR_RETURN(table.tables[section->name], TableOfSection(*section));
    }
  }
  // Refuses an unknown codec by name, and tables that do not fit it.
  TESSERA_RETURN_IF_ERROR(MakeDecoder(table).status());
  return table;
}

absl::Status AddCoefficients(const BtfelTable& table, const std::vector<int64_t>& extents,
                             Container& container) {
  std::vector<int64_t> shape = extents;
  shape.push_back(table.num_coefficients);
  int64_t num_codes = 1;
  for (const int64_t extent : shape) {
    if (extent < 1 || __builtin_mul_overflow(num_codes, extent, &num_codes)) {
      num_codes = -1;
      break;
    }
  }
  if (num_codes < 0 || static_cast<size_t>(num_codes) != table.codes.size()) {
    return absl::InvalidArgumentError(absl::StrCat("section 'coefficients': ", table.codes.size(),
                                                   " codes do not fill shape [", absl::StrJoin(shape, ", "),
                                                   "]"));
  }
  Section section;
  section.name = "coefficients";
  section.shape = std::move(shape);
  section.codes = &table.codes;
  container.sections.push_back(std::move(section));
  return absl::OkStatus();
}

absl::StatusOr<std::vector<int64_t>> ReadCoefficients(const Container& container, size_t rank,
                                                      BtfelTable& table) {
  std::vector<int64_t> shape(rank, -1);
  shape.push_back(table.num_coefficients);
  TESSERA_ASSIGN_OR_RETURN(const Section* section,
                           RequireSection(container, "coefficients", DType::kU8, shape));
  std::vector<int64_t> extents(section->shape.begin(), section->shape.end() - 1);
  if (std::ranges::any_of(
          extents, [](int64_t extent) { return extent < 1 || extent > std::numeric_limits<int>::max(); })) {
    return absl::InvalidArgumentError("section 'coefficients': an extent is 0 or above 2^31 - 1");
  }
  TESSERA_ASSIGN_OR_RETURN(table.codes, CodeBuffer::Create(section->bytes.size(), kInMemory));
  std::memcpy(table.codes.data(), section->bytes.data(), section->bytes.size());
  return extents;
}

absl::Status AddCoefficientsByEnergy(const BtfelTable& table, Container& container) {
  TESSERA_RETURN_IF_ERROR(CheckQuantisation(table));
  const size_t k = static_cast<size_t>(table.num_coefficients);
  if (table.codes.size() % k != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(table.codes.size(), " codes are not a multiple of ", k, " coefficients"));
  }
  const size_t n = table.size();
  const std::vector<uint32_t> order = EnergyOrder(table);
  container.sections.push_back(
      MakeSection<uint32_t>("btfel_order", {static_cast<int64_t>(k)}, std::span<const uint32_t>(order)));
  size_t begin = 0;
  size_t num_sections = 0;
  for (const double share : kSplitShares) {
    const size_t end = static_cast<size_t>(std::ceil(share * static_cast<double>(k)));
    const size_t columns = end - begin;
    if (columns == 0) {
      continue;  // fewer coefficients than parts
    }
    Section section;
    section.name = EnergySectionName(num_sections++);
    section.dtype = DType::kU8;
    section.shape = {static_cast<int64_t>(n), static_cast<int64_t>(columns)};
    section.bytes.resize(n * columns);
    for (size_t row = 0; row < n; ++row) {
      for (size_t column = 0; column < columns; ++column) {
        section.bytes[row * columns + column] =
            static_cast<char>(table.codes[row * k + order[begin + column]]);
      }
    }
    container.sections.push_back(std::move(section));
    begin = end;
  }
  return absl::OkStatus();
}

absl::Status ReadCoefficientsByEnergy(const Container& container, BtfelTable& table) {
  const size_t k = static_cast<size_t>(table.num_coefficients);
  TESSERA_ASSIGN_OR_RETURN(
      const Section* order_section,
      RequireSection(container, "btfel_order", DType::kU32, std::array<int64_t, 1>{table.num_coefficients}));
  const std::vector<uint32_t> order = SectionValues<uint32_t>(*order_section);
  std::vector<bool> seen(k, false);
  for (const uint32_t coefficient : order) {
    if (coefficient >= k || seen[coefficient]) {
      return absl::InvalidArgumentError(
          absl::StrCat("section 'btfel_order': ", coefficient, " is out of range or appears twice"));
    }
    seen[coefficient] = true;
  }
  // Every section is checked before the table is allocated: its size is then that of the sections.
  std::vector<const Section*> sections;
  size_t num_columns = 0;
  while (num_columns < k) {
    const int64_t num_rows = sections.empty() ? -1 : sections[0]->shape[0];
    TESSERA_ASSIGN_OR_RETURN(const Section* section,
                             RequireSection(container, EnergySectionName(sections.size()), DType::kU8,
                                            std::array<int64_t, 2>{num_rows, -1}));
    if (section->shape[1] < 1 || static_cast<size_t>(section->shape[1]) > k - num_columns) {
      return absl::InvalidArgumentError(absl::StrCat("section '", section->name, "': ", section->shape[1],
                                                     " columns, expected 1 to ", k - num_columns));
    }
    num_columns += static_cast<size_t>(section->shape[1]);
    sections.push_back(section);
  }
  const size_t n = static_cast<size_t>(sections[0]->shape[0]);
  TESSERA_ASSIGN_OR_RETURN(table.codes, CodeBuffer::Create(n * k, kInMemory));
  size_t begin = 0;
  for (const Section* section : sections) {
    const size_t columns = static_cast<size_t>(section->shape[1]);
    for (size_t row = 0; row < n; ++row) {
      for (size_t column = 0; column < columns; ++column) {
        table.codes[row * k + order[begin + column]] =
            static_cast<uint8_t>(section->bytes[row * columns + column]);
      }
    }
    begin += columns;
  }
  return absl::OkStatus();
}

void AddProvenance(const Provenance& provenance, Container& container) {
  container.header["source"] = provenance.source;
  container.header["licence"] = provenance.licence;
  container.header["citation"] = provenance.citation;
}

absl::StatusOr<Provenance> ReadProvenance(const Container& container) {
  Provenance provenance;
  TESSERA_ASSIGN_OR_RETURN(provenance.source, HeaderString(container.header, "source"));
  TESSERA_ASSIGN_OR_RETURN(provenance.licence, HeaderString(container.header, "licence"));
  TESSERA_ASSIGN_OR_RETURN(provenance.citation, HeaderString(container.header, "citation"));
  return provenance;
}

}  // namespace tessera
