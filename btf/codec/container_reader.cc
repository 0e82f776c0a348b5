#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <optional>
#include <set>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>
#include <zstd.h>

#include "btf/base/status_macros.h"
#include "btf/codec/container.h"
#include "btf/codec/container_layout.h"

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little, "sections are read as they lie in memory");

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
  if (!IsSectionName(name)) {
    return InvalidSection(place, "its name is not [a-z0-9_.]{1,64}");
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string dtype_name, StringField(json, "dtype", name));
  const auto* dtype = std::ranges::find(kDTypeNames, std::string_view(dtype_name),
                                        &std::pair<DType, std::string_view>::second);
  if (dtype == kDTypeNames.end()) {
    return absl::UnimplementedError(absl::StrCat("section '", name, "': unknown dtype '", dtype_name, "'"));
  }
  entry.section.dtype = dtype->first;
  TESSERA_ASSIGN_OR_RETURN(const std::string encoding, StringField(json, "encoding", name));
  if (encoding != "none" && encoding != "zstd") {
    return absl::UnimplementedError(absl::StrCat("section '", name, "': unknown encoding '", encoding, "'"));
  }
  entry.section.encoding = encoding == "zstd" ? Encoding::kZstd : Encoding::kNone;

  const auto shape = json.find("shape");
  if (shape == json.end() || !shape->is_array() || shape->size() > kMaxSectionRank) {
    return InvalidSection(name,
                          absl::StrCat("shape is not an array of at most ", kMaxSectionRank, " extents"));
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
    if (entry.offset % kSectionAlignment != 0 || entry.offset < header_end) {
      return InvalidSection(name, absl::StrCat("offset ", entry.offset, " is not a multiple of ",
                                               kSectionAlignment, " behind the header"));
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
    if (gap.size() >= kSectionAlignment || gap.find_first_not_of('\0') != std::string_view::npos) {
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
  const uint32_t crc32 = SectionCrc32(stored);
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

absl::StatusOr<Container> ParseContainer(std::span<const std::byte> bytes) {
  const std::string_view file(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (file.substr(0, kContainerMagic.size()) !=
      std::string_view(kContainerMagic.data(), std::min(kContainerMagic.size(), file.size()))) {
    return absl::InvalidArgumentError("not a Tessera container: the magic is missing");
  }
  if (file.size() < kContainerPreambleBytes) {
    return absl::DataLossError(
        absl::StrCat("truncated: ", file.size(), " bytes, the preamble alone has ", kContainerPreambleBytes));
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
  if (header_bytes > file.size() - kContainerPreambleBytes) {
    return absl::DataLossError(
        absl::StrCat("header: ", header_bytes, " bytes exceed the file's ", file.size()));
  }
  const std::string_view text = file.substr(kContainerPreambleBytes, header_bytes);
  TESSERA_RETURN_IF_ERROR(CheckHeaderText(text));
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
  TESSERA_RETURN_IF_ERROR(CheckLayout(entries, kContainerPreambleBytes + header_bytes, file));
  std::ranges::stable_sort(entries, {}, &Entry::offset);
  for (Entry& entry : entries) {
    TESSERA_RETURN_IF_ERROR(Decode(entry, file.substr(entry.offset, entry.stored_bytes)));
    container.sections.push_back(std::move(entry.section));
  }
  return container;
}

}  // namespace tessera
