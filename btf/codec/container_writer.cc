#include <bit>
#include <set>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <zstd.h>

#include "btf/base/status_macros.h"
#include "btf/codec/container.h"
#include "btf/codec/container_layout.h"

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little, "sections are written as they lie in memory");

constexpr int kZstdLevel = 3;

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
    if (!IsSectionName(section.name)) {
      return InvalidSection(section.name, "names are [a-z0-9_.]{1,64}");
    }
    if (!names.insert(section.name).second) {
      return InvalidSection(section.name, "appears twice");
    }
    if (section.shape.size() > kMaxSectionRank) {
      return InvalidSection(section.name,
                            absl::StrCat("rank ", section.shape.size(), ", at most ", kMaxSectionRank));
    }
    const std::optional<uint64_t> expected = ArrayBytes(section.shape, section.dtype);
    if (!expected || *expected != section.bytes.size()) {
      return InvalidSection(section.name, absl::StrCat(section.bytes.size(), " bytes do not fill shape [",
                                                       absl::StrJoin(section.shape, ", "), "]"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

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
      entry["crc32"] = SectionCrc32(bodies[i]);
      header["sections"].push_back(std::move(entry));
      offset = AlignSection(offset + bodies[i].size());
    }
    return header.dump();
  };
  std::string text;
  uint64_t data_begin = 0;
  try {
    constexpr uint64_t kLongestOffset = 20;
    data_begin =
        AlignSection(kContainerPreambleBytes + header_text(0).size() + kLongestOffset * stored.size());
    text = header_text(data_begin);
  } catch (const nlohmann::json::exception& e) {
    return absl::InvalidArgumentError(absl::StrCat("header: ", e.what()));
  }
  text.resize(data_begin - kContainerPreambleBytes, ' ');
  if (text.size() > kMaxHeaderBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("header: ", text.size(), " bytes, at most ", kMaxHeaderBytes));
  }
  TESSERA_RETURN_IF_ERROR(CheckHeaderText(text));

  std::string file(kContainerMagic.data(), kContainerMagic.size());
  const auto append_u32 = [&file](uint32_t value) {
    file.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  append_u32(kContainerVersion);
  append_u32(static_cast<uint32_t>(text.size()));
  file += text;
  for (const std::string_view body : bodies) {
    file.resize(AlignSection(file.size()), '\0');
    file += body;
  }
  return file;
}

}  // namespace tessera
