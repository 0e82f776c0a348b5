// What the two halves of tile_set_parts share. Private to tile_set_*.cc.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/container.h"

namespace tessera {

inline constexpr char kTileSetPartKind[] = "tile_set_part";
// Header `labels`: what texels name, pixels of the exemplar or BTFels of the whole set.
inline constexpr char kPixelLabels[] = "source_pixels";
inline constexpr char kBtfelLabels[] = "btfels";
// Transforms take time with the cube of it.
inline constexpr int kMostBlockSide = 128;
inline constexpr int kMostLevel = 12;

// A section with one extent; none where there are no values.
template <typename T>
void AddVector(const std::string& name, const std::vector<T>& values, Container& container) {
  if (!values.empty()) {
    container.sections.push_back(
        MakeSection<T>(name, {static_cast<int64_t>(values.size())}, std::span<const T>(values)));
  }
}

// A section with one extent; of no values where it is missing, as those are left out. Errors:
// RequireSection's.
template <typename T>
absl::StatusOr<std::vector<T>> ReadVector(const Container& container, std::string_view name) {
  if (container.Find(name) == nullptr) {
    return std::vector<T>();
  }
  TESSERA_ASSIGN_OR_RETURN(const Section* section,
                           RequireSection(container, name, DTypeOf<T>::value, std::array<int64_t, 1>{-1}));
  return SectionValues<T>(*section);
}

inline bool AllFiniteValues(std::span<const float> values) {
  return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
}

// With so many values, finite.
inline absl::StatusOr<std::vector<float>> ReadFinite(const Container& container, std::string_view name,
                                                     size_t count) {
  TESSERA_ASSIGN_OR_RETURN(std::vector<float> values, ReadVector<float>(container, name));
  if (values.size() != count || !AllFiniteValues(values)) {
    return absl::InvalidArgumentError(absl::StrCat("section '", absl::string_view(name.data(), name.size()),
                                                   "': ", values.size(), " values, expected ", count,
                                                   " finite ones"));
  }
  return values;
}

// body(tile) for the tiles named, or for all.
inline void ForTiles(const std::vector<uint32_t>& tiles, size_t num_tiles,
                     const std::function<void(size_t tile)>& body) {
  if (tiles.empty()) {
    for (size_t tile = 0; tile < num_tiles; ++tile) {
      body(tile);
    }
  }
  for (const uint32_t tile : tiles) {
    body(tile);
  }
}

}  // namespace tessera
