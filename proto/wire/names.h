// Resource names: `materials/M`, `jobs/J`, `arrangements/A`, `arrangements/A/tileSets/T`. M and T are
// [a-z0-9-]{1,63}, J is a positive decimal number, A an arrangement's id.
//
// Every parser returns INVALID_ARGUMENT with reason NAME_INVALID, the name and the legal form.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include <absl/status/statusor.h>

namespace tessera {

// M of `materials/M`.
[[nodiscard]] absl::StatusOr<std::string> ParseMaterialName(std::string_view name);
[[nodiscard]] std::string MaterialName(std::string_view material);

// J of `jobs/J`.
[[nodiscard]] absl::StatusOr<int64_t> ParseJobName(std::string_view name);
[[nodiscard]] std::string JobName(int64_t job);

// A of `arrangements/A`.
[[nodiscard]] absl::StatusOr<std::string> ParseArrangementName(std::string_view name);
[[nodiscard]] std::string ArrangementName(std::string_view arrangement);

struct TileSetId {
  std::string arrangement;  // A
  std::string tile_set;     // T
  friend bool operator==(const TileSetId&, const TileSetId&) = default;
};
[[nodiscard]] absl::StatusOr<TileSetId> ParseTileSetName(std::string_view name);
[[nodiscard]] std::string TileSetName(const TileSetId& id);

// `arrangements/A/tileSets/T/thumbnail`, what a job that draws a tile set makes.
[[nodiscard]] absl::StatusOr<TileSetId> ParseThumbnailName(std::string_view name);
[[nodiscard]] std::string ThumbnailName(const TileSetId& id);

// OK for 64 lower-case hexadecimal digits. Errors: INVALID_ARGUMENT with reason ARGUMENT_INVALID and subject
// `field`.
[[nodiscard]] absl::Status CheckDigest(std::string_view sha256, std::string_view field);

}  // namespace tessera
