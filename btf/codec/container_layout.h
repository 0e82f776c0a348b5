// What the writer and the reader of containers share: the constants of FORMAT.md and its rules for names,
// shapes, expansion and headers. Private to container*.cc.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <absl/status/status.h>

#include "btf/codec/container.h"

namespace tessera {

inline constexpr std::array<char, 8> kContainerMagic = {'T', 'E', 'S', 'S', 'E', 'R', 'A', '\0'};
inline constexpr uint64_t kContainerPreambleBytes = 16;
inline constexpr uint64_t kSectionAlignment = 64;
inline constexpr size_t kMaxSectionRank = 8;
inline constexpr std::array<std::pair<DType, std::string_view>, 5> kDTypeNames = {{{DType::kU8, "u8"},
                                                                                   {DType::kU16, "u16"},
                                                                                   {DType::kU32, "u32"},
                                                                                   {DType::kF32, "f32"},
                                                                                   {DType::kF64, "f64"}}};

// The first multiple of kSectionAlignment at or behind `offset`.
[[nodiscard]] constexpr uint64_t AlignSection(uint64_t offset) {
  return (offset + kSectionAlignment - 1) / kSectionAlignment * kSectionAlignment;
}

// zlib's CRC-32 of a section's stored bytes; piece by piece, `before` being that of the pieces before.
[[nodiscard]] uint32_t SectionCrc32(std::string_view bytes, uint32_t before = 0);

// [a-z0-9_.]{1,64}
[[nodiscard]] bool IsSectionName(std::string_view name);

// INVALID_ARGUMENT "section 'NAME': WHAT".
[[nodiscard]] absl::Status InvalidSection(std::string_view name, std::string_view what);

// Bytes of an array, or nothing when an extent is negative or the product does not fit. A zero extent does
// not excuse the others: readers multiply them in any order.
[[nodiscard]] std::optional<uint64_t> ArrayBytes(const std::vector<int64_t>& shape, DType dtype);

// Whether a compressed section obeys kMaxExpansion and kMaxExpansionSlackBytes.
[[nodiscard]] bool ExpandsWithinLimits(uint64_t raw_bytes, uint64_t stored_bytes);

// Bounds the depth and the number of values of JSON text without building it: each value takes tens of bytes
// in memory. Errors: INVALID_ARGUMENT naming the limit.
[[nodiscard]] absl::Status CheckHeaderText(std::string_view text);

}  // namespace tessera
