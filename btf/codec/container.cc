#include "btf/codec/container.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <optional>
#include <set>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <zlib.h>
#include <zstd.h>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little, "sections are written as they lie in memory");

constexpr std::array<char, 8> kMagic = {'T', 'E', 'S', 'S', 'E', 'R', 'A', '\0'};
constexpr uint64_t kPreambleBytes = 16;
constexpr uint64_t kAlignment = 64;
constexpr size_t kMaxRank = 8;
constexpr size_t kMaxNameBytes = 64;
// Bounds on the header before it is parsed: its values take tens of bytes each in memory.
constexpr int kMaxHeaderDepth = 64;
constexpr int64_t kMaxHeaderValues = int64_t{1} << 20;
constexpr int kZstdLevel = 3;

constexpr std::array<std::pair<DType, std::string_view>, 5> kDTypes = {{{DType::kU8, "u8"},
                                                                        {DType::kU16, "u16"},
                                                                        {DType::kU32, "u32"},
                                                                        {DType::kF32, "f32"},
                                                                        {DType::kF64, "f64"}}};

constexpr uint64_t AlignUp(uint64_t offset) {
  return (offset + kAlignment - 1) / kAlignment * kAlignment;
}

uint32_t Crc32(std::string_view bytes) {
  return static_cast<uint32_t>(
      crc32_z(crc32_z(0, nullptr, 0), reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

bool IsLegalName(std::string_view name) {
  return !name.empty() && name.size() <= kMaxNameBytes && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
  });
}

absl::Status InvalidSection(std::string_view name, std::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("section '", absl::string_view(name.data(), name.size()),
                                                 "': ", absl::string_view(what.data(), what.size())));
}

// Bytes of an array, or nothing when an extent is negative or the product does not fit. A zero extent does
// not excuse the others: readers multiply them in any order.
std::optional<uint64_t> ArrayBytes(const std::vector<int64_t>& shape, DType dtype) {
  uint64_t bytes = DTypeSize(dtype);
  bool is_empty = false;
  for (const int64_t extent : shape) {
    is_empty |= extent == 0;
    if (extent < 0 ||
        __builtin_mul_overflow(bytes, static_cast<uint64_t>(std::max<int64_t>(extent, 1)), &bytes)) {
      return std::nullopt;
    }
  }
  if (bytes > static_cast<uint64_t>(std::numeric_limits<int64_t>::max())) {
    return std::nullopt;
  }
  return is_empty ? 0 : bytes;
}

bool ExpandsWithinLimits(uint64_t raw_bytes, uint64_t stored_bytes) {
  return raw_bytes <= kMaxExpansionSlackBytes ||
         (raw_bytes - kMaxExpansionSlackBytes + kMaxExpansion - 1) / kMaxExpansion <= stored_bytes;
}

// ------------------------------------------------------------------------------------------------ writing

struct StoredSection {
  Encoding encoding = Encoding::kNone;
  std::string compressed;  // when zstd
};

absl::StatusOr<StoredSection> Store(const Section& section, uint64_t& expanded_bytes) {
  StoredSection stored;
  if (section.encoding == Encoding::kNone || section.bytes.empty()) {
    return stored;
  }
  stored.compressed.resize(ZSTD_compressBound(section.bytes.size()));
  const size_t size = ZSTD_compress(stored.compressed.data(), stored.compressed.size(), section.bytes.data(),
                                    section.bytes.size(), kZstdLevel);
  if (ZSTD_isError(size)) {
    return absl::InternalError(absl::StrCat("section '", section.name, "': zstd: ", ZSTD_getErrorName(size)));
  }
  stored.compressed.resize(size);
  if (size < section.bytes.size() && ExpandsWithinLimits(section.bytes.size(), size) &&
      section.bytes.size() <= kMaxExpandedBytes - expanded_bytes) {
    stored.encoding = Encoding::kZstd;
    expanded_bytes += section.bytes.size();
  } else {
    stored.compressed.clear();
  }
  return stored;
}

absl::Status CheckSections(const Container& container) {
  if (container.sections.size() > kMaxSections) {
    return absl::InvalidArgumentError(
        absl::StrCat(container.sections.size(), " sections, at most ", kMaxSections));
  }
  std::set<std::string_view> names;
  for (const Section& section : container.sections) {
    if (!IsLegalName(section.name)) {
      return InvalidSection(section.name, "names are [a-z0-9_.]{1,64}");
    }
    if (!names.insert(section.name).second) {
      return InvalidSection(section.name, "appears twice");
    }
    if (section.shape.size() > kMaxRank) {
      return InvalidSection(section.name,
                            absl::StrCat("rank ", section.shape.size(), ", at most ", kMaxRank));
    }
    const std::optional<uint64_t> expected = ArrayBytes(section.shape, section.dtype);
    if (!expected || *expected != section.bytes.size()) {
      return InvalidSection(section.name, absl::StrCat(section.bytes.size(), " bytes do not fill shape [",
                                                       absl::StrJoin(section.shape, ", "), "]"));
    }
  }
  return absl::OkStatus();
}

// ------------------------------------------------------------------------------------------------ reading

// Depth and number of values of JSON text, without building it.
absl::Status CheckHeaderSize(std::string_view text) {
  int depth = 0;
  int64_t num_values = 1;
  bool in_string = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') {
        ++i;
      } else if (c == '"') {
        in_string = false;
      }
      continue;
    }
    if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      ++num_values;
      if (++depth > kMaxHeaderDepth) {
        return absl::InvalidArgumentError(absl::StrCat("header: nested deeper than ", kMaxHeaderDepth));
      }
    } else if (c == ']' || c == '}') {
      --depth;
    } else if (c == ',' && ++num_values > kMaxHeaderValues) {
      return absl::InvalidArgumentError(absl::StrCat("header: more than ", kMaxHeaderValues, " values"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<uint64_t> UnsignedField(const nlohmann::json& entry, const char* key, std::string_view name) {
  const auto it = entry.find(key);
  if (it == entry.end() || !it->is_number_unsigned()) {
    return InvalidSection(name, absl::StrCat(key, " is not an unsigned integer"));
  }
  return it->get<uint64_t>();
}

absl::StatusOr<std::string> StringField(const nlohmann::json& entry, const char* key, std::string_view name) {
  const auto it = entry.find(key);
  if (it == entry.end() || !it->is_string()) {
    return InvalidSection(name, absl::StrCat(key, " is not a string"));
  }
  return it->get<std::string>();
}

struct Extent {
  uint64_t begin = 0;
  uint64_t end = 0;
  std::string_view name;
};

// One entry of `sections`, with where its bytes lie.
struct Entry {
  Section section;  // without bytes
  uint64_t offset = 0;
  uint64_t stored_bytes = 0;
  uint64_t raw_bytes = 0;
  uint32_t crc32 = 0;
};

absl::StatusOr<Entry> ParseEntry(const nlohmann::json& json, size_t index) {
  const std::string place = absl::StrCat("#", index);
  if (!json.is_object()) {
    return InvalidSection(place, "its entry is not an object");
  }
  Entry entry;
  TESSERA_ASSIGN_OR_RETURN(entry.section.name, StringField(json, "name", place));
  const std::string& name = entry.section.name;
  if (!IsLegalName(name)) {
    return InvalidSection(place, "its name is not [a-z0-9_.]{1,64}");
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string dtype_name, StringField(json, "dtype", name));
  const auto* dtype =
      std::ranges::find(kDTypes, std::string_view(dtype_name), &std::pair<DType, std::string_view>::second);
  if (dtype == kDTypes.end()) {
    return absl::UnimplementedError(absl::StrCat("section '", name, "': unknown dtype '", dtype_name, "'"));
  }
  entry.section.dtype = dtype->first;
  TESSERA_ASSIGN_OR_RETURN(const std::string encoding, StringField(json, "encoding", name));
  if (encoding != "none" && encoding != "zstd") {
    return absl::UnimplementedError(absl::StrCat("section '", name, "': unknown encoding '", encoding, "'"));
  }
  entry.section.encoding = encoding == "zstd" ? Encoding::kZstd : Encoding::kNone;

  const auto shape = json.find("shape");
  if (shape == json.end() || !shape->is_array() || shape->size() > kMaxRank) {
    return InvalidSection(name, absl::StrCat("shape is not an array of at most ", kMaxRank, " extents"));
  }
  for (const nlohmann::json& extent : *shape) {
    if (!extent.is_number_unsigned() ||
        extent.get<uint64_t>() > static_cast<uint64_t>(std::numeric_limits<int64_t>::max())) {
      return InvalidSection(name, "an extent of its shape is not an unsigned integer");
    }
    entry.section.shape.push_back(extent.get<int64_t>());
  }
  TESSERA_ASSIGN_OR_RETURN(entry.offset, UnsignedField(json, "offset", name));
  TESSERA_ASSIGN_OR_RETURN(entry.stored_bytes, UnsignedField(json, "stored_bytes", name));
  TESSERA_ASSIGN_OR_RETURN(entry.raw_bytes, UnsignedField(json, "raw_bytes", name));
  TESSERA_ASSIGN_OR_RETURN(const uint64_t crc32, UnsignedField(json, "crc32", name));
  if (crc32 > std::numeric_limits<uint32_t>::max()) {
    return InvalidSection(name, absl::StrCat("crc32 ", crc32, " has more than 32 bits"));
  }
  entry.crc32 = static_cast<uint32_t>(crc32);
  const std::optional<uint64_t> array_bytes = ArrayBytes(entry.section.shape, entry.section.dtype);
  if (!array_bytes || *array_bytes != entry.raw_bytes) {
    return InvalidSection(name, absl::StrCat("raw_bytes ", entry.raw_bytes, " does not fit shape [",
                                             absl::StrJoin(entry.section.shape, ", "), "] of ", dtype_name));
  }
  if (entry.section.encoding == Encoding::kNone && entry.stored_bytes != entry.raw_bytes) {
    return InvalidSection(name, absl::StrCat("stored_bytes ", entry.stored_bytes, ", expected raw_bytes ",
                                             entry.raw_bytes, " with encoding none"));
  }
  if (!ExpandsWithinLimits(entry.raw_bytes, entry.stored_bytes)) {
    return InvalidSection(name, absl::StrCat(entry.stored_bytes, " stored bytes expand to ", entry.raw_bytes,
                                             ", at most ", kMaxExpansion, " times and 64 KiB"));
  }
  for (const auto& [key, value] : json.items()) {
    static constexpr std::array<std::string_view, 8> kKnown = {
        "name", "dtype", "shape", "offset", "stored_bytes", "raw_bytes", "encoding", "crc32"};
    if (std::ranges::find(kKnown, std::string_view(key)) == kKnown.end()) {
      entry.section.other_keys[key] = value;
    }
  }
  return entry;
}

// Sections lie behind the header, aligned, apart from each other, with zeros between, and fill the file.
absl::Status CheckLayout(const std::vector<Entry>& entries, uint64_t header_end, std::string_view file) {
  std::vector<Extent> extents;
  std::set<std::string_view> names;
  uint64_t expanded_bytes = 0;
  for (const Entry& entry : entries) {
    const std::string& name = entry.section.name;
    if (!names.insert(name).second) {
      return InvalidSection(name, "appears twice");
    }
    if (entry.offset % kAlignment != 0 || entry.offset < header_end) {
      return InvalidSection(name, absl::StrCat("offset ", entry.offset, " is not a multiple of ", kAlignment,
                                               " behind the header"));
    }
    if (entry.offset > file.size() || entry.stored_bytes > file.size() - entry.offset) {
      return absl::DataLossError(absl::StrCat("section '", name, "': ", entry.stored_bytes,
                                              " bytes at offset ", entry.offset, " exceed the file's ",
                                              file.size(), " bytes"));
    }
    if (entry.section.encoding == Encoding::kZstd) {
      if (entry.raw_bytes > kMaxExpandedBytes - expanded_bytes) {
        return InvalidSection(
            name, absl::StrCat("compressed sections expand to more than ", kMaxExpandedBytes, " bytes"));
      }
      expanded_bytes += entry.raw_bytes;
    }
    extents.push_back({entry.offset, entry.offset + entry.stored_bytes, name});
  }
  std::ranges::sort(extents, {}, [](const Extent& e) { return std::pair(e.begin, e.end); });
  extents.push_back({file.size(), file.size(), ""});
  uint64_t end = header_end;
  std::string_view previous = "header";
  for (const Extent& extent : extents) {
    if (extent.begin < end) {
      return InvalidSection(extent.name, absl::StrCat("overlaps '", std::string(previous), "'"));
    }
    const std::string_view gap = file.substr(end, extent.begin - end);
    if (gap.size() >= kAlignment || gap.find_first_not_of('\0') != std::string_view::npos) {
      return absl::DataLossError(absl::StrCat("bytes ", end, " to ", extent.begin, " behind section '",
                                              std::string(previous), "' belong to no section"));
    }
    end = extent.end;
    previous = extent.name;
  }
  return absl::OkStatus();
}

absl::Status Decode(Entry& entry, std::string_view stored) {
  Section& section = entry.section;
  const uint32_t crc32 = Crc32(stored);
  if (crc32 != entry.crc32) {
    return absl::DataLossError(
        absl::StrFormat("section '%s': crc32 %08x, expected %08x", section.name, crc32, entry.crc32));
  }
  if (section.encoding == Encoding::kNone) {
    section.bytes.assign(stored);
    return absl::OkStatus();
  }
  section.bytes.resize(entry.raw_bytes);
  const size_t size =
      ZSTD_decompress(section.bytes.data(), section.bytes.size(), stored.data(), stored.size());
  if (ZSTD_isError(size) || size != entry.raw_bytes) {
    return absl::DataLossError(
        absl::StrCat("section '", section.name,
                     "': zstd: ", ZSTD_isError(size) ? ZSTD_getErrorName(size) : "fewer bytes than raw_bytes",
                     ", expected ", entry.raw_bytes, " bytes"));
  }
  return absl::OkStatus();
}

}  // namespace

std::string_view DTypeName(DType dtype) {
  return std::ranges::find(kDTypes, dtype, &std::pair<DType, std::string_view>::first)->second;
}

size_t DTypeSize(DType dtype) {
  switch (dtype) {
    case DType::kU8:
      return 1;
    case DType::kU16:
      return 2;
    case DType::kU32:
    case DType::kF32:
      return 4;
    case DType::kF64:
      return 8;
  }
  return 0;
}

const Section* Container::Find(std::string_view name) const {
  const auto it = std::ranges::find(sections, name, &Section::name);
  return it == sections.end() ? nullptr : &*it;
}

absl::StatusOr<std::string> SerializeContainer(const Container& container) {
  if (!container.header.is_object()) {
    return absl::InvalidArgumentError("header: not a JSON object");
  }
  TESSERA_RETURN_IF_ERROR(CheckSections(container));
  std::vector<StoredSection> stored;
  std::vector<std::string_view> bodies;
  uint64_t expanded_bytes = 0;
  stored.reserve(container.sections.size());
  for (const Section& section : container.sections) {
    TESSERA_ASSIGN_OR_RETURN(StoredSection one, Store(section, expanded_bytes));
    stored.push_back(std::move(one));
    bodies.push_back(stored.back().encoding == Encoding::kZstd ? stored.back().compressed : section.bytes);
  }

  // Offsets are part of the header, and its length moves them: leave room for their longest form.
  const auto header_text = [&](uint64_t data_begin) {
    nlohmann::json header = container.header;
    header["kind"] = container.kind;
    header["sections"] = nlohmann::json::array();
    uint64_t offset = data_begin;
    for (size_t i = 0; i < stored.size(); ++i) {
      const Section& section = container.sections[i];
      nlohmann::json entry = section.other_keys;
      entry["name"] = section.name;
      entry["dtype"] = DTypeName(section.dtype);
      entry["shape"] = section.shape;
      entry["offset"] = offset;
      entry["stored_bytes"] = bodies[i].size();
      entry["raw_bytes"] = section.bytes.size();
      entry["encoding"] = stored[i].encoding == Encoding::kZstd ? "zstd" : "none";
      entry["crc32"] = Crc32(bodies[i]);
      header["sections"].push_back(std::move(entry));
      offset = AlignUp(offset + bodies[i].size());
    }
    return header.dump();
  };
  std::string text;
  uint64_t data_begin = 0;
  try {
    constexpr uint64_t kLongestOffset = 20;
    data_begin = AlignUp(kPreambleBytes + header_text(0).size() + kLongestOffset * stored.size());
    text = header_text(data_begin);
  } catch (const nlohmann::json::exception& e) {
    return absl::InvalidArgumentError(absl::StrCat("header: ", e.what()));
  }
  text.resize(data_begin - kPreambleBytes, ' ');
  if (text.size() > kMaxHeaderBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("header: ", text.size(), " bytes, at most ", kMaxHeaderBytes));
  }
  TESSERA_RETURN_IF_ERROR(CheckHeaderSize(text));

  std::string file(kMagic.data(), kMagic.size());
  const auto append_u32 = [&file](uint32_t value) {
    file.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  append_u32(kContainerVersion);
  append_u32(static_cast<uint32_t>(text.size()));
  file += text;
  for (const std::string_view body : bodies) {
    file.resize(AlignUp(file.size()), '\0');
    file += body;
  }
  return file;
}

absl::StatusOr<Container> ParseContainer(std::span<const std::byte> bytes) {
  const std::string_view file(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (file.substr(0, kMagic.size()) !=
      std::string_view(kMagic.data(), std::min(kMagic.size(), file.size()))) {
    return absl::InvalidArgumentError("not a Tessera container: the magic is missing");
  }
  if (file.size() < kPreambleBytes) {
    return absl::DataLossError(
        absl::StrCat("truncated: ", file.size(), " bytes, the preamble alone has ", kPreambleBytes));
  }
  uint32_t version = 0;
  uint32_t header_bytes = 0;
  std::memcpy(&version, file.data() + 8, sizeof(version));
  std::memcpy(&header_bytes, file.data() + 12, sizeof(header_bytes));
  if (version != kContainerVersion) {
    return absl::UnimplementedError(
        absl::StrCat("container version ", version, ", this library reads ", kContainerVersion));
  }
  if (header_bytes > kMaxHeaderBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("header: ", header_bytes, " bytes, at most ", kMaxHeaderBytes));
  }
  if (header_bytes > file.size() - kPreambleBytes) {
    return absl::DataLossError(
        absl::StrCat("header: ", header_bytes, " bytes exceed the file's ", file.size()));
  }
  const std::string_view text = file.substr(kPreambleBytes, header_bytes);
  TESSERA_RETURN_IF_ERROR(CheckHeaderSize(text));
  Container container;
  container.header = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!container.header.is_object()) {
    return absl::InvalidArgumentError("header: not a JSON object in UTF-8");
  }
  const auto kind = container.header.find("kind");
  if (kind == container.header.end() || !kind->is_string()) {
    return absl::InvalidArgumentError("header: kind is not a string");
  }
  container.kind = kind->get<std::string>();
  const auto sections = container.header.find("sections");
  if (sections == container.header.end() || !sections->is_array() || sections->size() > kMaxSections) {
    return absl::InvalidArgumentError(
        absl::StrCat("header: sections is not an array of at most ", kMaxSections));
  }
  std::vector<Entry> entries;
  for (size_t i = 0; i < sections->size(); ++i) {
    TESSERA_ASSIGN_OR_RETURN(Entry entry, ParseEntry((*sections)[i], i));
    entries.push_back(std::move(entry));
  }
  container.header.erase("kind");
  container.header.erase("sections");
  TESSERA_RETURN_IF_ERROR(CheckLayout(entries, kPreambleBytes + header_bytes, file));
  std::ranges::stable_sort(entries, {}, &Entry::offset);
  for (Entry& entry : entries) {
    TESSERA_RETURN_IF_ERROR(Decode(entry, file.substr(entry.offset, entry.stored_bytes)));
    container.sections.push_back(std::move(entry.section));
  }
  return container;
}

absl::StatusOr<const Section*> RequireSection(const Container& container, std::string_view name, DType dtype,
                                              std::span<const int64_t> shape) {
  const Section* section = container.Find(name);
  if (section == nullptr) {
    return InvalidSection(name, absl::StrCat("missing from a container of kind '", container.kind, "'"));
  }
  bool fits = section->dtype == dtype && section->shape.size() == shape.size();
  for (size_t i = 0; fits && i < shape.size(); ++i) {
    fits = shape[i] == -1 || section->shape[i] == shape[i];
  }
  if (!fits) {
    std::string expected;
    for (const int64_t extent : shape) {
      absl::StrAppend(&expected, expected.empty() ? "" : ", ", extent == -1 ? "n" : absl::StrCat(extent));
    }
    return InvalidSection(
        name, absl::StrCat(std::string(DTypeName(section->dtype)), " [", absl::StrJoin(section->shape, ", "),
                           "], expected ", std::string(DTypeName(dtype)), " [", expected, "]"));
  }
  return section;
}

absl::StatusOr<std::string> HeaderString(const nlohmann::json& header, std::string_view key) {
  const auto it = header.find(std::string(key));
  if (it == header.end()) {
    return std::string();
  }
  if (!it->is_string()) {
    return absl::InvalidArgumentError(absl::StrCat("header: ", std::string(key), " is not a string"));
  }
  return it->get<std::string>();
}

}  // namespace tessera
