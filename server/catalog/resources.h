// The catalog's named things: materials and tile sets, and the log of answered mutations.
//
// Functions that take a Database run inside the caller's transaction. Lists come in order of name.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "proto/wire/names.h"
#include "server/catalog/page.h"
#include "server/catalog/sqlite.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

enum class OnTaken { kRefuse, kReplace };

// Points materials/M to a blob; message.blob and message.create_time are filled in, the name is material's.
// Errors: ALREADY_EXISTS (NAME_TAKEN) with kRefuse, NOT_FOUND (BLOB_MISSING).
[[nodiscard]] absl::StatusOr<v1::Material> PutMaterial(Database& db, const std::string& material,
                                                       const std::string& blob_sha256, v1::Material message,
                                                       OnTaken on_taken, int64_t now_ms);
// Errors: NOT_FOUND.
[[nodiscard]] absl::StatusOr<v1::Material> GetMaterial(Database& db, const std::string& material);
[[nodiscard]] absl::StatusOr<v1::ListMaterialsResponse> ListMaterials(Database& db, const Page& page);
// Errors: NOT_FOUND. The blob stays for a day.
[[nodiscard]] absl::Status DeleteMaterial(Database& db, const std::string& material, int64_t now_ms);

// The same for tile sets. message.thumbnail is kept as it is given: what the name had before goes.
[[nodiscard]] absl::StatusOr<v1::TileSet> PutTileSet(Database& db, const TileSetId& id,
                                                     const std::string& blob_sha256, v1::TileSet message,
                                                     OnTaken on_taken, int64_t now_ms);
[[nodiscard]] absl::StatusOr<v1::TileSet> GetTileSet(Database& db, const TileSetId& id);
// `arrangement` empty: of all. The list's name in page tokens is TileSetList(arrangement).
[[nodiscard]] absl::StatusOr<v1::ListTileSetsResponse> ListTileSets(Database& db,
                                                                    const std::string& arrangement,
                                                                    const Page& page);
[[nodiscard]] absl::Status DeleteTileSet(Database& db, const TileSetId& id, int64_t now_ms);
// Makes a blob the picture of a tile set. Errors: NOT_FOUND, also of the blob (BLOB_MISSING);
// FAILED_PRECONDITION when the name does not point to `tile_set_sha256` any more.
[[nodiscard]] absl::Status PutThumbnail(Database& db, const TileSetId& id, const std::string& tile_set_sha256,
                                        const std::string& thumbnail_sha256, int64_t now_ms);

inline constexpr std::string_view kMaterialList = "materials";
[[nodiscard]] std::string TileSetList(const std::string& arrangement);

// Errors: ALREADY_EXISTS (NAME_TAKEN) when something has the full name `name`.
[[nodiscard]] absl::Status CheckNameFree(Database& db, const std::string& name);

// Counts and sizes for GetServerStatus.
[[nodiscard]] absl::Status FillCounts(Database& db, v1::ServerStatus& status);

inline constexpr int64_t kRequestsKeptMs = int64_t{7} * 24 * 3600 * 1000;

// The answer recorded for this id, none when it is new. Errors: INVALID_ARGUMENT when the id was used with
// another content.
[[nodiscard]] absl::StatusOr<std::optional<std::string>> FindAnswer(Database& db,
                                                                    const std::string& request_id,
                                                                    const std::string& request_sha256);
[[nodiscard]] absl::Status RecordAnswer(Database& db, const std::string& request_id,
                                        const std::string& request_sha256, const std::string& response,
                                        int64_t now_ms);
// Drops answers older than kRequestsKeptMs.
[[nodiscard]] absl::Status ForgetOldAnswers(Database& db, int64_t now_ms);

}  // namespace tessera
