// The container of materials, tile sets and dressings: a JSON header and named, typed, checksummed sections.
// FORMAT.md describes the bytes in full, for readers without this library.
//
//   0  8  magic "TESSERA\0"        8  4  container version        12  4  header bytes      (little-endian)
//   16 .  header: UTF-8 JSON, at most 16 MiB, padded with spaces so that the first section starts right after
//   .     sections, each at a multiple of 64 bytes; the bytes between them are 0
//
//   Container c{.kind = "material"};
//   c.sections.push_back(MakeSection<float>("offset", {k}, offset));
//   TESSERA_ASSIGN_OR_RETURN(std::string bytes, SerializeContainer(c));
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

namespace tessera {

class CodeBuffer;

inline constexpr uint32_t kContainerVersion = 1;
inline constexpr uint64_t kMaxHeaderBytes = uint64_t{16} << 20;
inline constexpr int kMaxSections = 1024;
// A compressed section may expand to at most this many times its stored bytes plus 64 KiB, and all of them
// together to at most 2 GiB: what a hostile file can make a reader allocate stays in proportion.
inline constexpr uint64_t kMaxExpansion = 256;
inline constexpr uint64_t kMaxExpansionSlackBytes = uint64_t{64} << 10;
inline constexpr uint64_t kMaxExpandedBytes = uint64_t{2} << 30;

enum class DType { kU8, kU16, kU32, kF32, kF64 };
enum class Encoding { kNone, kZstd };

[[nodiscard]] std::string_view DTypeName(DType dtype);  // "u8", "u16", "u32", "f32", "f64"
[[nodiscard]] size_t DTypeSize(DType dtype);            // bytes of one element

template <typename T>
struct DTypeOf;
template <>
struct DTypeOf<uint8_t> {
  static constexpr DType value = DType::kU8;
};
template <>
struct DTypeOf<uint16_t> {
  static constexpr DType value = DType::kU16;
};
template <>
struct DTypeOf<uint32_t> {
  static constexpr DType value = DType::kU32;
};
template <>
struct DTypeOf<float> {
  static constexpr DType value = DType::kF32;
};
template <>
struct DTypeOf<double> {
  static constexpr DType value = DType::kF64;
};

// One typed array, row-major, little-endian, held decoded.
struct Section {
  std::string name;  // [a-z0-9_.]{1,64}, unique in its container
  DType dtype = DType::kU8;
  std::vector<int64_t> shape;  // at most 8 extents, each >= 0; none means one element
  std::string bytes;           // product of shape * DTypeSize(dtype)
  // In a container that is about to be written, the bytes may be a table's codes in place of `bytes`: not
  // copied, not owned, stored as they are.
  const CodeBuffer* codes = nullptr;
  // How it is stored. Asking for zstd is a wish: a section that would expand beyond the limits above, or
  // would not shrink, is stored as it is.
  Encoding encoding = Encoding::kNone;
  // Keys of its header entry that this version does not know; written back as they were.
  nlohmann::json other_keys = nlohmann::json::object();
};

struct Container {
  std::string kind;                                  // "material", "tile_set", "dressing"
  nlohmann::json header = nlohmann::json::object();  // every key but `kind` and `sections`, unknown ones too
  std::vector<Section> sections;                     // in file order

  // nullptr when there is none of this name. Linear in the number of sections.
  [[nodiscard]] const Section* Find(std::string_view name) const;
};

// A container file that is put together as it is read, so that writing and sending it takes no memory beyond
// the container's own. What its sections do not own must stay alive and unchanged. Thread-safe.
class ContainerFile {
 public:
  // Same container, same bytes, on every machine (one zstd version assumed where zstd is asked for). Reads
  // every section once, for its checksum. Errors: INVALID_ARGUMENT naming the section whose name, shape or
  // size is illegal, or the header when it is not UTF-8 or too large; CodeBuffer::Read's.
  [[nodiscard]] static absl::StatusOr<ContainerFile> Create(Container container);

  [[nodiscard]] uint64_t size_bytes() const { return size_bytes_; }
  // Fills `bytes` with those of the file from `offset` on; they lie within its size. Errors:
  // CodeBuffer::Read's.
  [[nodiscard]] absl::Status Read(uint64_t offset, std::span<std::byte> bytes) const;
  // The whole file.
  [[nodiscard]] absl::StatusOr<std::string> ReadAll() const;

 private:
  ContainerFile() = default;

  std::string head_;               // up to where the first section may lie
  std::vector<Section> sections_;  // as they are stored
  std::vector<uint64_t> offsets_;  // [section]
  uint64_t size_bytes_ = 0;
};

// ContainerFile::ReadAll. Errors: those of ContainerFile.
[[nodiscard]] absl::StatusOr<std::string> SerializeContainer(Container container);

// Safe on hostile bytes: every size is checked before it is used or allocated.
// Errors: INVALID_ARGUMENT (not a container, a header that breaks a rule), DATA_LOSS (truncated, checksum),
// UNIMPLEMENTED (unknown container version, dtype or encoding, by name). Messages name the section.
[[nodiscard]] absl::StatusOr<Container> ParseContainer(std::span<const std::byte> bytes);

// A section holding a copy of `values`.
template <typename T>
[[nodiscard]] Section MakeSection(std::string name, std::vector<int64_t> shape, std::span<const T> values) {
  Section section;
  section.name = std::move(name);
  section.dtype = DTypeOf<T>::value;
  section.shape = std::move(shape);
  section.bytes.assign(reinterpret_cast<const char*>(values.data()), values.size_bytes());
  return section;
}

// The section of this name, checked to be of T's dtype and of `shape`, in which -1 stands for any extent.
// Errors: INVALID_ARGUMENT naming the section, what it is and what was expected.
[[nodiscard]] absl::StatusOr<const Section*> RequireSection(const Container& container, std::string_view name,
                                                            DType dtype, std::span<const int64_t> shape);

// The elements of a section whose dtype is T's.
template <typename T>
[[nodiscard]] std::vector<T> SectionValues(const Section& section) {
  std::vector<T> values(section.bytes.size() / sizeof(T));
  if (!values.empty()) {
    std::memcpy(values.data(), section.bytes.data(), values.size() * sizeof(T));
  }
  return values;
}

// Errors: INVALID_ARGUMENT naming the kind and the one expected.
[[nodiscard]] absl::Status RequireKind(const Container& container, std::string_view kind);

// header[key] as a string, "" when absent. Errors: INVALID_ARGUMENT when it is something else.
[[nodiscard]] absl::StatusOr<std::string> HeaderString(const nlohmann::json& header, std::string_view key);

}  // namespace tessera
