#include <algorithm>
#include <bit>
#include <set>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <zstd.h>

#include "btf/base/status_macros.h"
#include "btf/codec/code_buffer.h"
#include "btf/codec/container.h"
#include "btf/codec/container_layout.h"

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little, "sections are written as they lie in memory");

constexpr int kZstdLevel = 3;
constexpr uint64_t kPieceBytes = uint64_t{1} << 20;

uint64_t SizeOf(const Section& section) {
  return section.codes != nullptr ? section.codes->size() : section.bytes.size();
}

absl::Status ReadSection(const Section& section, uint64_t offset, std::span<std::byte> bytes) {
  if (section.codes != nullptr) {
    return section.codes->Read(offset, {reinterpret_cast<uint8_t*>(bytes.data()), bytes.size()});
  }
  std::memcpy(bytes.data(), section.bytes.data() + offset, bytes.size());
  return absl::OkStatus();
}

absl::StatusOr<uint32_t> Crc32Of(const Section& section) {
  if (section.codes == nullptr) {
    return SectionCrc32(section.bytes);
  }
  uint32_t crc32 = 0;
  const uint64_t size = SizeOf(section);
  std::string piece(std::min(size, kPieceBytes), '\0');
  for (uint64_t offset = 0; offset < size; offset += piece.size()) {
    piece.resize(std::min(kPieceBytes, size - offset));
    TESSERA_RETURN_IF_ERROR(ReadSection(section, offset, std::as_writable_bytes(std::span(piece))));
    crc32 = SectionCrc32(piece, crc32);
  }
  return crc32;
}

// Puts the compressed bytes in the place of the section's own, where that was asked for and is worth it.
absl::Status Compress(Section& section, uint64_t& expanded_bytes) {
  const bool asked = std::exchange(section.encoding, Encoding::kNone) == Encoding::kZstd;
  if (!asked || section.bytes.empty()) {
    return absl::OkStatus();
  }
  std::string compressed(ZSTD_compressBound(section.bytes.size()), '\0');
  const size_t size = ZSTD_compress(compressed.data(), compressed.size(), section.bytes.data(),
                                    section.bytes.size(), kZstdLevel);
  if (ZSTD_isError(size)) {
    return absl::InternalError(absl::StrCat("section '", section.name, "': zstd: ", ZSTD_getErrorName(size)));
  }
  if (size < section.bytes.size() && ExpandsWithinLimits(section.bytes.size(), size) &&
      section.bytes.size() <= kMaxExpandedBytes - expanded_bytes) {
    section.encoding = Encoding::kZstd;
    expanded_bytes += section.bytes.size();
    compressed.resize(size);
    section.bytes = std::move(compressed);
  }
  return absl::OkStatus();
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
    if (!section.other_keys.is_object()) {
      return InvalidSection(section.name, "its other keys are not an object");
    }
    const std::optional<uint64_t> expected = ArrayBytes(section.shape, section.dtype);
    if (!expected || *expected != SizeOf(section)) {
      return InvalidSection(section.name, absl::StrCat(SizeOf(section), " bytes do not fill shape [",
                                                       absl::StrJoin(section.shape, ", "), "]"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ContainerFile> ContainerFile::Create(Container container) {
  if (!container.header.is_object()) {
    return absl::InvalidArgumentError("header: not a JSON object");
  }
  TESSERA_RETURN_IF_ERROR(CheckSections(container));
  std::vector<nlohmann::json> entries;
  uint64_t expanded_bytes = 0;
  for (Section& section : container.sections) {
    nlohmann::json entry = section.other_keys;
    entry["name"] = section.name;
    entry["dtype"] = DTypeName(section.dtype);
    entry["shape"] = section.shape;
    entry["raw_bytes"] = SizeOf(section);
    TESSERA_RETURN_IF_ERROR(Compress(section, expanded_bytes));
    entry["stored_bytes"] = SizeOf(section);
    entry["encoding"] = section.encoding == Encoding::kZstd ? "zstd" : "none";
    TESSERA_ASSIGN_OR_RETURN(entry["crc32"], Crc32Of(section));
    entries.push_back(std::move(entry));
  }

  ContainerFile file;
  file.sections_ = std::move(container.sections);
  // Offsets are part of the header, and its length moves them: leave room for their longest form.
  const auto header_text = [&](uint64_t data_begin) {
    nlohmann::json header = container.header;
    header["kind"] = container.kind;
    file.offsets_.clear();
    uint64_t offset = data_begin;
    for (size_t i = 0; i < entries.size(); ++i) {
      entries[i]["offset"] = offset;
      file.offsets_.push_back(offset);
      file.size_bytes_ = offset + SizeOf(file.sections_[i]);
      offset = AlignSection(file.size_bytes_);
    }
    header["sections"] = entries;
    return header.dump();
  };
  std::string text;
  uint64_t data_begin = 0;
  try {
    constexpr uint64_t kLongestOffset = 20;
    data_begin =
        AlignSection(kContainerPreambleBytes + header_text(0).size() + kLongestOffset * entries.size());
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

  file.head_.assign(kContainerMagic.data(), kContainerMagic.size());
  const auto append_u32 = [&file](uint32_t value) {
    file.head_.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  append_u32(kContainerVersion);
  append_u32(static_cast<uint32_t>(text.size()));
  file.head_ += text;
  file.size_bytes_ = std::max<uint64_t>(file.size_bytes_, file.head_.size());
  return file;
}

absl::Status ContainerFile::Read(uint64_t offset, std::span<std::byte> bytes) const {
  // The part of `bytes` that [begin, begin + size) of the file falls on, empty where it misses.
  const auto overlap = [&](uint64_t begin, uint64_t size) {
    const uint64_t first = std::clamp(begin, offset, offset + bytes.size());
    const uint64_t last = std::clamp(begin + size, offset, offset + bytes.size());
    return bytes.subspan(first - offset, last - first);
  };
  std::ranges::fill(bytes, std::byte{0});  // as it is between sections
  if (const std::span<std::byte> part = overlap(0, head_.size()); !part.empty()) {
    std::memcpy(part.data(), head_.data() + offset, part.size());
  }
  // From the last section that begins at or before `offset`.
  const auto after = std::ranges::upper_bound(offsets_, offset);
  for (size_t i = after == offsets_.begin() ? 0 : after - offsets_.begin() - 1;
       i < sections_.size() && offsets_[i] < offset + bytes.size(); ++i) {
    if (const std::span<std::byte> part = overlap(offsets_[i], SizeOf(sections_[i])); !part.empty()) {
      const uint64_t begin = offset + (part.data() - bytes.data()) - offsets_[i];
      TESSERA_RETURN_IF_ERROR(ReadSection(sections_[i], begin, part));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> ContainerFile::ReadAll() const {
  std::string bytes(size_bytes_, '\0');
  TESSERA_RETURN_IF_ERROR(Read(0, std::as_writable_bytes(std::span(bytes))));
  return bytes;
}

absl::StatusOr<std::string> SerializeContainer(Container container) {
  TESSERA_ASSIGN_OR_RETURN(const ContainerFile file, ContainerFile::Create(std::move(container)));
  return file.ReadAll();
}

}  // namespace tessera
