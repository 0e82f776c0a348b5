#include "server/catalog/resources.h"

#include <google/protobuf/util/time_util.h>

#include <absl/strings/str_cat.h>

#include "proto/wire/status.h"

namespace tessera {
namespace {

using google::protobuf::util::TimeUtil;

// A page ends early beyond this size: clients take messages of 4 MiB by default.
constexpr size_t kPageBytes = 1 << 20;

absl::Status NameTaken(const std::string& name) {
  return WithReason(absl::AlreadyExistsError(absl::StrCat(name, " exists; set replace to take its name")),
                    "NAME_TAKEN", name);
}

absl::Status NoSuch(const std::string& name) {
  return WithReason(absl::NotFoundError(absl::StrCat(name, " does not exist")), "NOT_FOUND", name);
}

absl::StatusOr<v1::Blob> FindBlob(Database& db, const std::string& sha256) {
  TESSERA_ASSIGN_OR_RETURN(Statement row, db.Query("SELECT size_bytes FROM blobs WHERE sha256 = ?", sha256));
  TESSERA_ASSIGN_OR_RETURN(const bool exists, row.Step());
  if (!exists) {
    return WithReason(absl::NotFoundError(absl::StrCat("the server has no blob ", sha256)), "BLOB_MISSING",
                      sha256);
  }
  v1::Blob blob;
  blob.set_sha256(sha256);
  blob.set_size_bytes(static_cast<uint64_t>(row.Int(0)));
  return blob;
}

// Starts the day for which a blob is kept after its name let it go.
absl::Status TouchBlob(Database& db, const std::string& sha256, int64_t now_ms) {
  return db.Run("UPDATE blobs SET touch_ms = ? WHERE sha256 = ?", now_ms, sha256);
}

// What a tile set lets go of when it is deleted or replaced.
absl::Status TouchBlobsOf(Database& db, const v1::TileSet& tile_set, int64_t now_ms) {
  TESSERA_RETURN_IF_ERROR(TouchBlob(db, tile_set.blob().sha256(), now_ms));
  return TouchBlob(db, tile_set.thumbnail().sha256(), now_ms);
}

constexpr std::string_view kMaterialColumns =
    "SELECT name, blob_sha256, size_bytes, width, height, codec, num_coefficients, num_views, num_lights, "
    "source,"
    " licence, citation, radiometry, metadata_json, create_ms"
    " FROM materials JOIN blobs ON blobs.sha256 = materials.blob_sha256 ";

v1::Material MaterialOfRow(const Statement& row) {
  v1::Material message;
  message.set_name(MaterialName(row.Text(0)));
  message.mutable_blob()->set_sha256(row.Text(1));
  message.mutable_blob()->set_size_bytes(static_cast<uint64_t>(row.Int(2)));
  message.set_width(static_cast<uint32_t>(row.Int(3)));
  message.set_height(static_cast<uint32_t>(row.Int(4)));
  message.set_codec(row.Text(5));
  message.set_num_coefficients(static_cast<uint32_t>(row.Int(6)));
  message.set_num_views(static_cast<uint32_t>(row.Int(7)));
  message.set_num_lights(static_cast<uint32_t>(row.Int(8)));
  message.mutable_provenance()->set_source(row.Text(9));
  message.mutable_provenance()->set_licence(row.Text(10));
  message.mutable_provenance()->set_citation(row.Text(11));
  message.set_radiometry(row.Text(12));
  message.set_metadata_json(row.Text(13));
  *message.mutable_create_time() = TimeUtil::MillisecondsToTimestamp(row.Int(14));
  return message;
}

constexpr std::string_view kTileSetColumns =
    "SELECT arrangement, name, blob_sha256, blobs.size_bytes, arrangement_sha256, tile_size, strip_height,"
    " num_tiles, num_btfels, codec, source, licence, citation, certificate_json, metadata_json, create_ms,"
    " thumbnail_sha256, thumbnails.size_bytes"
    " FROM tile_sets JOIN blobs ON blobs.sha256 = tile_sets.blob_sha256"
    " LEFT JOIN blobs AS thumbnails ON thumbnails.sha256 = tile_sets.thumbnail_sha256 ";

v1::TileSet TileSetOfRow(const Statement& row) {
  v1::TileSet message;
  message.set_name(TileSetName({row.Text(0), row.Text(1)}));
  message.mutable_blob()->set_sha256(row.Text(2));
  message.mutable_blob()->set_size_bytes(static_cast<uint64_t>(row.Int(3)));
  message.set_arrangement_sha256(row.Text(4));
  message.set_tile_size(static_cast<uint32_t>(row.Int(5)));
  message.set_strip_height(static_cast<uint32_t>(row.Int(6)));
  message.set_num_tiles(static_cast<uint32_t>(row.Int(7)));
  message.set_num_btfels(static_cast<uint32_t>(row.Int(8)));
  message.set_codec(row.Text(9));
  message.mutable_provenance()->set_source(row.Text(10));
  message.mutable_provenance()->set_licence(row.Text(11));
  message.mutable_provenance()->set_citation(row.Text(12));
  message.set_certificate_json(row.Text(13));
  message.set_metadata_json(row.Text(14));
  *message.mutable_create_time() = TimeUtil::MillisecondsToTimestamp(row.Int(15));
  if (!row.IsNull(16)) {
    message.mutable_thumbnail()->set_sha256(row.Text(16));
    message.mutable_thumbnail()->set_size_bytes(static_cast<uint64_t>(row.Int(17)));
  }
  return message;
}

// The first row made a message. Errors: NOT_FOUND naming `name` when there is none.
template <typename Message>
absl::StatusOr<Message> OnlyRow(absl::StatusOr<Statement> rows, const std::string& name,
                                Message (*message_of_row)(const Statement&)) {
  TESSERA_RETURN_IF_ERROR(rows.status());
  TESSERA_ASSIGN_OR_RETURN(const bool exists, rows->Step());
  if (!exists) {
    return NoSuch(name);
  }
  return message_of_row(*rows);
}

}  // namespace

absl::StatusOr<v1::Material> PutMaterial(Database& db, const std::string& material,
                                         const std::string& blob_sha256, v1::Material message,
                                         OnTaken on_taken, int64_t now_ms) {
  message.set_name(MaterialName(material));
  TESSERA_ASSIGN_OR_RETURN(*message.mutable_blob(), FindBlob(db, blob_sha256));
  *message.mutable_create_time() = TimeUtil::MillisecondsToTimestamp(now_ms);
  const absl::StatusOr<v1::Material> old = GetMaterial(db, material);
  if (old.ok()) {
    if (on_taken == OnTaken::kRefuse) {
      return NameTaken(message.name());
    }
    TESSERA_RETURN_IF_ERROR(TouchBlob(db, old->blob().sha256(), now_ms));
  } else if (old.status().code() != absl::StatusCode::kNotFound) {
    return old.status();
  }
  TESSERA_RETURN_IF_ERROR(
      db.Run("INSERT OR REPLACE INTO materials (name, blob_sha256, width, height, codec, num_coefficients, "
             "num_views,"
             " num_lights, source, licence, citation, radiometry, metadata_json, create_ms)"
             " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
             material, blob_sha256, message.width(), message.height(), message.codec(),
             message.num_coefficients(), message.num_views(), message.num_lights(),
             message.provenance().source(), message.provenance().licence(), message.provenance().citation(),
             message.radiometry(), message.metadata_json(), now_ms));
  return message;
}

absl::StatusOr<v1::Material> GetMaterial(Database& db, const std::string& material) {
  return OnlyRow(db.Query(std::string(kMaterialColumns) + "WHERE name = ?", material), MaterialName(material),
                 &MaterialOfRow);
}

absl::StatusOr<v1::ListMaterialsResponse> ListMaterials(Database& db, const Page& page) {
  TESSERA_ASSIGN_OR_RETURN(Statement rows,
                           db.Query(std::string(kMaterialColumns) + "WHERE name > ? ORDER BY name LIMIT ?",
                                    page.after, page.size + 1));
  v1::ListMaterialsResponse response;
  std::string last;
  for (;;) {
    TESSERA_ASSIGN_OR_RETURN(const bool more, rows.Step());
    if (!more) {
      return response;
    }
    if (response.materials_size() == static_cast<int>(page.size) || response.ByteSizeLong() > kPageBytes) {
      response.set_next_page_token(PageToken(kMaterialList, last));
      return response;
    }
    last = rows.Text(0);
    *response.add_materials() = MaterialOfRow(rows);
  }
}

absl::Status DeleteMaterial(Database& db, const std::string& material, int64_t now_ms) {
  TESSERA_ASSIGN_OR_RETURN(const v1::Material old, GetMaterial(db, material));
  TESSERA_RETURN_IF_ERROR(TouchBlob(db, old.blob().sha256(), now_ms));
  return db.Run("DELETE FROM materials WHERE name = ?", material);
}

absl::StatusOr<v1::TileSet> PutTileSet(Database& db, const TileSetId& id, const std::string& blob_sha256,
                                       v1::TileSet message, OnTaken on_taken, int64_t now_ms) {
  message.set_name(TileSetName(id));
  TESSERA_ASSIGN_OR_RETURN(*message.mutable_blob(), FindBlob(db, blob_sha256));
  *message.mutable_create_time() = TimeUtil::MillisecondsToTimestamp(now_ms);
  const absl::StatusOr<v1::TileSet> old = GetTileSet(db, id);
  if (old.ok()) {
    if (on_taken == OnTaken::kRefuse) {
      return NameTaken(message.name());
    }
    TESSERA_RETURN_IF_ERROR(TouchBlobsOf(db, *old, now_ms));
  } else if (old.status().code() != absl::StatusCode::kNotFound) {
    return old.status();
  }
  std::optional<std::string> thumbnail_sha256;
  if (message.has_thumbnail()) {
    thumbnail_sha256 = message.thumbnail().sha256();
  }
  TESSERA_RETURN_IF_ERROR(db.Run(
      "INSERT OR REPLACE INTO tile_sets (arrangement, name, blob_sha256, arrangement_sha256, tile_size,"
      " strip_height, num_tiles, num_btfels, codec, source, licence, citation, certificate_json,"
      " metadata_json, create_ms, thumbnail_sha256)"
      " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
      id.arrangement, id.tile_set, blob_sha256, message.arrangement_sha256(), message.tile_size(),
      message.strip_height(), message.num_tiles(), message.num_btfels(), message.codec(),
      message.provenance().source(), message.provenance().licence(), message.provenance().citation(),
      message.certificate_json(), message.metadata_json(), now_ms, thumbnail_sha256));
  return message;
}

absl::StatusOr<v1::TileSet> GetTileSet(Database& db, const TileSetId& id) {
  return OnlyRow(db.Query(std::string(kTileSetColumns) + "WHERE arrangement = ? AND name = ?", id.arrangement,
                          id.tile_set),
                 TileSetName(id), &TileSetOfRow);
}

std::string TileSetList(const std::string& arrangement) {
  return absl::StrCat("tile_sets/", arrangement);
}

absl::StatusOr<v1::ListTileSetsResponse> ListTileSets(Database& db, const std::string& arrangement,
                                                      const Page& page) {
  // The key of a row is "A/T"; '/' sorts before every letter of a name but after '-', so the pair is
  // compared.
  const size_t slash = page.after.find('/');
  const std::string after_arrangement = page.after.substr(0, slash);
  const std::string after_name = slash == std::string::npos ? "" : page.after.substr(slash + 1);
  TESSERA_ASSIGN_OR_RETURN(
      Statement rows, db.Query(std::string(kTileSetColumns) +
                                   "WHERE (?1 = '' OR arrangement = ?1) AND (arrangement, name) > (?2, ?3)"
                                   " ORDER BY arrangement, name LIMIT ?4",
                               arrangement, after_arrangement, after_name, page.size + 1));
  v1::ListTileSetsResponse response;
  std::string last;
  for (;;) {
    TESSERA_ASSIGN_OR_RETURN(const bool more, rows.Step());
    if (!more) {
      return response;
    }
    if (response.tile_sets_size() == static_cast<int>(page.size) || response.ByteSizeLong() > kPageBytes) {
      response.set_next_page_token(PageToken(TileSetList(arrangement), last));
      return response;
    }
    last = absl::StrCat(rows.Text(0), "/", rows.Text(1));
    *response.add_tile_sets() = TileSetOfRow(rows);
  }
}

absl::Status DeleteTileSet(Database& db, const TileSetId& id, int64_t now_ms) {
  TESSERA_ASSIGN_OR_RETURN(const v1::TileSet old, GetTileSet(db, id));
  TESSERA_RETURN_IF_ERROR(TouchBlobsOf(db, old, now_ms));
  return db.Run("DELETE FROM tile_sets WHERE arrangement = ? AND name = ?", id.arrangement, id.tile_set);
}

absl::Status PutThumbnail(Database& db, const TileSetId& id, const std::string& tile_set_sha256,
                          const std::string& thumbnail_sha256, int64_t now_ms) {
  TESSERA_ASSIGN_OR_RETURN(const v1::TileSet tile_set, GetTileSet(db, id));
  if (tile_set.blob().sha256() != tile_set_sha256) {
    return absl::FailedPreconditionError(absl::StrCat(tile_set.name(), " was replaced meanwhile"));
  }
  TESSERA_RETURN_IF_ERROR(FindBlob(db, thumbnail_sha256).status());
  TESSERA_RETURN_IF_ERROR(TouchBlob(db, tile_set.thumbnail().sha256(), now_ms));
  return db.Run("UPDATE tile_sets SET thumbnail_sha256 = ? WHERE arrangement = ? AND name = ?",
                thumbnail_sha256, id.arrangement, id.tile_set);
}

absl::Status CheckNameFree(Database& db, const std::string& name) {
  absl::Status found;
  if (const auto material = ParseMaterialName(name); material.ok()) {
    found = GetMaterial(db, *material).status();
  } else {
    TESSERA_ASSIGN_OR_RETURN(const TileSetId id, ParseTileSetName(name));
    found = GetTileSet(db, id).status();
  }
  if (found.ok()) {
    return NameTaken(name);
  }
  return found.code() == absl::StatusCode::kNotFound ? absl::OkStatus() : found;
}

absl::Status FillCounts(Database& db, v1::ServerStatus& status) {
  TESSERA_ASSIGN_OR_RETURN(Statement row,
                           db.Query("SELECT (SELECT count(*) FROM jobs WHERE state = 'QUEUED'),"
                                    " (SELECT count(*) FROM jobs WHERE state = 'RUNNING'),"
                                    " (SELECT count(*) FROM materials), (SELECT count(*) FROM tile_sets),"
                                    " (SELECT coalesce(sum(size_bytes), 0) FROM blobs)"));
  TESSERA_RETURN_IF_ERROR(row.Step().status());
  status.set_num_queued_jobs(static_cast<uint32_t>(row.Int(0)));
  status.set_num_running_jobs(static_cast<uint32_t>(row.Int(1)));
  status.set_num_materials(static_cast<uint32_t>(row.Int(2)));
  status.set_num_tile_sets(static_cast<uint32_t>(row.Int(3)));
  status.set_blob_bytes(static_cast<uint64_t>(row.Int(4)));
  return absl::OkStatus();
}

absl::StatusOr<std::optional<std::string>> FindAnswer(Database& db, const std::string& request_id,
                                                      const std::string& request_sha256) {
  TESSERA_ASSIGN_OR_RETURN(
      Statement row,
      db.Query("SELECT request_sha256, response FROM requests WHERE request_id = ?", request_id));
  TESSERA_ASSIGN_OR_RETURN(const bool known, row.Step());
  if (!known) {
    return std::nullopt;
  }
  if (row.Text(0) != request_sha256) {
    return WithReason(absl::InvalidArgumentError(absl::StrCat(
                          "request_id \"", request_id, "\" was used before for a request of other content")),
                      "ARGUMENT_INVALID", "request_id");
  }
  return row.Text(1);
}

absl::Status RecordAnswer(Database& db, const std::string& request_id, const std::string& request_sha256,
                          const std::string& response, int64_t now_ms) {
  return db.Run("INSERT INTO requests (request_id, request_sha256, response, create_ms) VALUES (?, ?, ?, ?)",
                request_id, request_sha256, BlobBytes{response}, now_ms);
}

absl::Status ForgetOldAnswers(Database& db, int64_t now_ms) {
  return db.Run("DELETE FROM requests WHERE create_ms < ?", now_ms - kRequestsKeptMs);
}

}  // namespace tessera
