#include "btf/codec/container_layout.h"

#include <algorithm>
#include <limits>

#include <absl/strings/str_cat.h>
#include <zlib.h>

namespace tessera {
namespace {

constexpr size_t kMaxNameBytes = 64;
constexpr int kMaxHeaderDepth = 64;
constexpr int64_t kMaxHeaderValues = int64_t{1} << 20;

}  // namespace

uint32_t SectionCrc32(std::string_view bytes, uint32_t before) {
  // Asked about no bytes at all, zlib answers with its initial value.
  return bytes.empty() ? before
                       : static_cast<uint32_t>(
                             crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

bool IsSectionName(std::string_view name) {
  return !name.empty() && name.size() <= kMaxNameBytes && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
  });
}

absl::Status InvalidSection(std::string_view name, std::string_view what) {
  return absl::InvalidArgumentError(absl::StrCat("section '", absl::string_view(name.data(), name.size()),
                                                 "': ", absl::string_view(what.data(), what.size())));
}

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

absl::Status CheckHeaderText(std::string_view text) {
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

}  // namespace tessera
