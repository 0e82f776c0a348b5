#include "server/rpc/tile_sets.h"

#include <algorithm>
#include <span>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "btf/base/status_macros.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/tile_set.h"
#include "proto/wire/convert.h"
#include "proto/wire/names.h"
#include "proto/wire/status.h"
#include "server/jobs/certify_job.h"
#include "server/jobs/synthesize_job.h"
#include "server/rpc/formats.h"

namespace tessera {

absl::StatusOr<v1::Job> TileSetsService::SynthesizeTileSet(
    const v1::SynthesizeTileSetRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const std::string material, ParseMaterialName(request.material()));
  const bool takes_material_name = request.name().ends_with('/');
  TESSERA_ASSIGN_OR_RETURN(
      const TileSetId id, ParseTileSetName(takes_material_name ? request.name() + material : request.name()));
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* const arrangement, FindArrangement(id.arrangement));
  TESSERA_RETURN_IF_ERROR(CheckSynthesizeRequest(request, *arrangement));
  v1::Job earlier;
  TESSERA_ASSIGN_OR_RETURN(const bool answered, FindEarlierAnswer(backend_, "SynthesizeTileSet",
                                                                  request.request_id(), request, earlier));
  if (answered) {
    return earlier;  // the material may be gone by now
  }
  std::string material_sha256;
  TESSERA_RETURN_IF_ERROR(backend_.connections.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(const v1::Material message, tessera::GetMaterial(db, material));
    material_sha256 = message.blob().sha256();
    return absl::OkStatus();
  }));
  v1::SynthesizeTileSetRequest params = request;
  params.set_name(ArrangementName(id.arrangement));
  params.clear_material();
  params.clear_replace();
  params.clear_request_id();
  FillDefaults(params);
  TESSERA_ASSIGN_OR_RETURN(const int version, backend_.pool.KindVersion("synthesize"));
  return QueueJob(backend_, "SynthesizeTileSet", request.request_id(), request,
                  {"synthesize",
                   version,
                   params.SerializeAsString(),
                   {material_sha256},
                   TileSetName(id),
                   request.replace() ? OnTaken::kReplace : OnTaken::kRefuse});
}

absl::StatusOr<v1::Job> TileSetsService::CertifyTileSet(const v1::CertifyTileSetRequest& request) const {
  v1::Job earlier;
  TESSERA_ASSIGN_OR_RETURN(const bool answered, FindEarlierAnswer(backend_, "CertifyTileSet",
                                                                  request.request_id(), request, earlier));
  if (answered) {
    return earlier;  // the tile set may be gone by now
  }
  TESSERA_ASSIGN_OR_RETURN(const v1::TileSet tile_set, GetNamed(request.name()));
  const nlohmann::json metadata =
      nlohmann::json::parse(tile_set.metadata_json(), nullptr, /*allow_exceptions=*/false);
  const auto digest = metadata.is_object() ? metadata.find(kMaterialDigestKey) : metadata.end();
  if (digest == metadata.end() || !digest->is_string()) {
    return WithReason(
        absl::FailedPreconditionError(absl::StrCat(
            request.name(), " does not record the material it was made of: synthesise it again")),
        "MATERIAL_UNKNOWN", request.name());
  }
  v1::CertifyTileSetRequest params = request;
  params.clear_name();
  params.clear_request_id();
  TESSERA_ASSIGN_OR_RETURN(const int version, backend_.pool.KindVersion(std::string(kCertifyKind)));
  return QueueJob(backend_, "CertifyTileSet", request.request_id(), request,
                  {std::string(kCertifyKind),
                   version,
                   params.SerializeAsString(),
                   {digest->get<std::string>(), tile_set.blob().sha256()},
                   tile_set.name(),
                   OnTaken::kReplace});
}

absl::StatusOr<v1::TileSet> TileSetsService::CreateTileSet(const v1::CreateTileSetRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const TileSetId id, ParseTileSetName(request.name()));
  TESSERA_RETURN_IF_ERROR(CheckDigest(request.blob_sha256(), "blob_sha256"));
  v1::TileSet response;
  TESSERA_ASSIGN_OR_RETURN(const bool answered, FindEarlierAnswer(backend_, "CreateTileSet",
                                                                  request.request_id(), request, response));
  if (answered) {
    return response;
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes,
                           backend_.blobs.ReadAll(request.blob_sha256(), kMaxContainerBytes));
  const absl::StatusOr<TileSet> tile_set = ParseTileSet(std::as_bytes(std::span(bytes)));
  if (!tile_set.ok()) {
    return FormatInvalid(tile_set.status(), request.blob_sha256());
  }
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement(id.arrangement));
  if (tile_set->arrangement_id != arrangement->id || tile_set->arrangement_sha256 != arrangement->sha256) {
    return WithReason(absl::InvalidArgumentError(absl::StrCat(
                          "the tile set is of ", tile_set->arrangement_id, " (", tile_set->arrangement_sha256,
                          "), the name says ", arrangement->id, " (", arrangement->sha256, ")")),
                      "ARRANGEMENT_MISMATCH", request.name());
  }
  const v1::TileSet description = MessageFromTileSet(*tile_set);
  TESSERA_RETURN_IF_ERROR(Mutate(
      backend_, "CreateTileSet", request.request_id(), request, response, [&](Database& db) -> absl::Status {
        TESSERA_ASSIGN_OR_RETURN(
            response, PutTileSet(db, id, request.blob_sha256(), description,
                                 request.replace() ? OnTaken::kReplace : OnTaken::kRefuse, backend_.clock()));
        return backend_.pool.QueueThumbnail(db, response);
      }));
  backend_.pool.Wake();
  return response;
}

absl::StatusOr<v1::TileSet> TileSetsService::GetTileSet(const v1::GetTileSetRequest& request) const {
  return GetNamed(request.name());
}

absl::StatusOr<v1::TileSet> TileSetsService::GetNamed(const std::string& name) const {
  TESSERA_ASSIGN_OR_RETURN(const TileSetId id, ParseTileSetName(name));
  v1::TileSet response;
  TESSERA_RETURN_IF_ERROR(backend_.connections.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(response, tessera::GetTileSet(db, id));
    return absl::OkStatus();
  }));
  return response;
}

absl::StatusOr<v1::ListTileSetsResponse> TileSetsService::ListTileSets(
    const v1::ListTileSetsRequest& request) const {
  std::string arrangement;
  if (!request.parent().empty()) {
    TESSERA_ASSIGN_OR_RETURN(arrangement, ParseArrangementName(request.parent()));
  }
  TESSERA_ASSIGN_OR_RETURN(const Page page,
                           ParsePage(TileSetList(arrangement), request.page_size(), request.page_token()));
  v1::ListTileSetsResponse response;
  TESSERA_RETURN_IF_ERROR(backend_.connections.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(response, tessera::ListTileSets(db, arrangement, page));
    return absl::OkStatus();
  }));
  return response;
}

absl::StatusOr<v1::DeleteTileSetResponse> TileSetsService::DeleteTileSet(
    const v1::DeleteTileSetRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const TileSetId id, ParseTileSetName(request.name()));
  v1::DeleteTileSetResponse response;
  TESSERA_RETURN_IF_ERROR(
      Mutate(backend_, "DeleteTileSet", request.request_id(), request, response,
             [&](Database& db) { return tessera::DeleteTileSet(db, id, backend_.clock()); }));
  return response;
}

absl::Status TileSetsService::StreamTileSet(const v1::StreamTileSetRequest& request,
                                            const IsCancelled& is_cancelled,
                                            const std::function<bool(const v1::TileSetChunk&)>& write) {
  TESSERA_ASSIGN_OR_RETURN(const SceneNeeds needs, SceneNeedsFromMessage(request.needs()));
  TESSERA_ASSIGN_OR_RETURN(const v1::TileSet tile_set, GetNamed(request.name()));
  PlannedStream planned;
  TESSERA_RETURN_IF_ERROR(RunForCaller(is_cancelled, [&](const RunContext& context) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(planned, streams_.Plan(tile_set, needs, context));
    return absl::OkStatus();
  }));
  v1::TileSetChunk chunk;
  *chunk.mutable_plan() = planned.plan;
  if (!write(chunk)) {
    return absl::CancelledError("the caller went away");
  }
  chunk.clear_plan();
  const auto is_held = [&](size_t part) {
    return std::ranges::find(request.held_parts(), part) != request.held_parts().end();
  };
  for (size_t part = 0; part < planned.parts.size() && !request.plan_only(); ++part) {
    const std::string& bytes = *planned.parts[part];
    chunk.set_part(static_cast<uint32_t>(part));
    for (size_t offset = 0; offset < bytes.size() && !is_held(part); offset += kChunkBytes) {
      chunk.set_data(bytes.substr(offset, kChunkBytes));
      if (!write(chunk)) {
        return absl::CancelledError("the caller went away");
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace tessera
