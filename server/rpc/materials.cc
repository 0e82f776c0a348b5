#include "server/rpc/materials.h"

#include <span>

#include "btf/base/status_macros.h"
#include "btf/codec/material.h"
#include "proto/wire/convert.h"
#include "proto/wire/names.h"
#include "server/jobs/generate_job.h"
#include "server/jobs/import_job.h"
#include "server/rpc/formats.h"

namespace tessera {

absl::StatusOr<v1::Material> MaterialsService::CreateMaterial(
    const v1::CreateMaterialRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const std::string name, ParseMaterialName(request.name()));
  TESSERA_RETURN_IF_ERROR(CheckDigest(request.blob_sha256(), "blob_sha256"));
  v1::Material response;
  TESSERA_ASSIGN_OR_RETURN(const bool answered, FindEarlierAnswer(backend_, "CreateMaterial",
                                                                  request.request_id(), request, response));
  if (answered) {
    return response;
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes,
                           backend_.blobs.ReadAll(request.blob_sha256(), kMaxContainerBytes));
  const absl::StatusOr<Material> material = ParseMaterial(std::as_bytes(std::span(bytes)));
  if (!material.ok()) {
    return FormatInvalid(material.status(), request.blob_sha256());
  }
  const v1::Material description = MessageFromMaterial(*material);
  TESSERA_RETURN_IF_ERROR(Mutate(
      backend_, "CreateMaterial", request.request_id(), request, response, [&](Database& db) -> absl::Status {
        TESSERA_ASSIGN_OR_RETURN(
            response,
            PutMaterial(db, name, request.blob_sha256(), description,
                        request.replace() ? OnTaken::kReplace : OnTaken::kRefuse, backend_.clock()));
        return absl::OkStatus();
      }));
  return response;
}

absl::StatusOr<v1::Job> MaterialsService::ImportMaterial(const v1::ImportMaterialRequest& request) const {
  TESSERA_RETURN_IF_ERROR(ParseMaterialName(request.name()).status());
  TESSERA_RETURN_IF_ERROR(CheckDigest(request.archive_sha256(), "archive_sha256"));
  TESSERA_RETURN_IF_ERROR(CheckImportRequest(request));
  v1::ImportMaterialRequest params = request;
  params.clear_name();
  params.clear_archive_sha256();
  params.clear_replace();
  params.clear_request_id();
  FillDefaults(*params.mutable_encode());
  TESSERA_ASSIGN_OR_RETURN(const int version, backend_.pool.KindVersion("import"));
  return QueueJob(backend_, "ImportMaterial", request.request_id(), request,
                  {"import",
                   version,
                   params.SerializeAsString(),
                   {request.archive_sha256()},
                   request.name(),
                   request.replace() ? OnTaken::kReplace : OnTaken::kRefuse});
}

absl::StatusOr<v1::Job> MaterialsService::GenerateMaterial(const v1::GenerateMaterialRequest& request) const {
  TESSERA_RETURN_IF_ERROR(ParseMaterialName(request.name()).status());
  TESSERA_RETURN_IF_ERROR(CheckGenerateRequest(request));
  v1::GenerateMaterialRequest params = request;
  params.clear_name();
  params.clear_replace();
  params.clear_request_id();
  FillDefaults(params);
  TESSERA_ASSIGN_OR_RETURN(const int version, backend_.pool.KindVersion("generate"));
  return QueueJob(backend_, "GenerateMaterial", request.request_id(), request,
                  {"generate", version, params.SerializeAsString(), GenerateInputs(request), request.name(),
                   request.replace() ? OnTaken::kReplace : OnTaken::kRefuse});
}

absl::StatusOr<v1::Material> MaterialsService::GetMaterial(const v1::GetMaterialRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const std::string name, ParseMaterialName(request.name()));
  v1::Material response;
  TESSERA_RETURN_IF_ERROR(backend_.connections.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(response, tessera::GetMaterial(db, name));
    return absl::OkStatus();
  }));
  return response;
}

absl::StatusOr<v1::ListMaterialsResponse> MaterialsService::ListMaterials(
    const v1::ListMaterialsRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const Page page,
                           ParsePage(kMaterialList, request.page_size(), request.page_token()));
  v1::ListMaterialsResponse response;
  TESSERA_RETURN_IF_ERROR(backend_.connections.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(response, tessera::ListMaterials(db, page));
    return absl::OkStatus();
  }));
  return response;
}

absl::StatusOr<v1::DeleteMaterialResponse> MaterialsService::DeleteMaterial(
    const v1::DeleteMaterialRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const std::string name, ParseMaterialName(request.name()));
  v1::DeleteMaterialResponse response;
  TESSERA_RETURN_IF_ERROR(
      Mutate(backend_, "DeleteMaterial", request.request_id(), request, response,
             [&](Database& db) { return tessera::DeleteMaterial(db, name, backend_.clock()); }));
  return response;
}

}  // namespace tessera
