#include "server/jobs/certify_job.h"

#include <span>

#include "btf/base/status_macros.h"
#include "btf/codec/material.h"
#include "btf/tiles/certificate.h"
#include "btf/wang/tile_set.h"
#include "proto/wire/convert.h"

namespace tessera {

absl::StatusOr<JobOutput> RunCertifyJob(const JobInput& input, const JobContext& context) {
  v1::CertifyTileSetRequest request;
  if (!request.ParseFromString(input.params) || input.inputs.size() != 2) {
    return absl::InternalError("a certify job takes a CertifyTileSetRequest and two blobs");
  }
  TESSERA_ASSIGN_OR_RETURN(std::string bytes, context.blobs->ReadAll(input.inputs[0], kMaxContainerBytes));
  TESSERA_ASSIGN_OR_RETURN(const Material material, ParseMaterial(std::as_bytes(std::span(bytes))));
  TESSERA_ASSIGN_OR_RETURN(bytes, context.blobs->ReadAll(input.inputs[1], kMaxContainerBytes));
  TESSERA_ASSIGN_OR_RETURN(TileSet tile_set, ParseTileSet(std::as_bytes(std::span(bytes))));
  std::string().swap(bytes);
  const CertificateImages which =
      request.all_images() ? CertificateImages::kAll : CertificateImages::kStratified;
  TESSERA_RETURN_IF_ERROR(CertifyTileSet(material, which, context.run, tile_set));
  TESSERA_ASSIGN_OR_RETURN(std::string container, SerializeTileSet(tile_set));
  return JobOutput{std::move(container), MessageFromTileSet(tile_set)};
}

}  // namespace tessera
