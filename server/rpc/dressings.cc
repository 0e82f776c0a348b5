#include "server/rpc/dressings.h"

#include <span>

#include "btf/base/status_macros.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dressing.h"
#include "btf/wang/mesh_io.h"
#include "btf/wang/shapes.h"
#include "proto/wire/names.h"
#include "proto/wire/status.h"
#include "server/rpc/formats.h"

namespace tessera {
namespace {

// OFF files begin with a word that ends in OFF ("OFF", "COFF", "NOFF"..); anything else is read as OBJ.
std::string_view MeshFileName(std::string_view bytes) {
  const std::string_view word = bytes.substr(0, bytes.find_first_of(" \t\r\n"));
  return word.size() <= 6 && word.ends_with("OFF") ? "mesh.off" : "mesh.obj";
}

}  // namespace

absl::StatusOr<QuadMesh> ReadUploadedMesh(const Backend& backend, const std::string& sha256) {
  TESSERA_RETURN_IF_ERROR(CheckDigest(sha256, "mesh_sha256"));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, backend.blobs.ReadAll(sha256, kMaxMeshBytes));
  absl::StatusOr<QuadMesh> mesh = ParseQuadMesh(std::as_bytes(std::span(bytes)), MeshFileName(bytes));
  if (!mesh.ok()) {
    return FormatInvalid(mesh.status(), sha256);
  }
  return mesh;
}

absl::StatusOr<DressResult> DressSurface(const QuadMesh& mesh, const std::string& arrangement_id,
                                         const DressParams& params, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement(arrangement_id));
  absl::StatusOr<DressResult> result = DressMesh(mesh, *arrangement, params, context);
  if (result.status().code() == absl::StatusCode::kFailedPrecondition) {
    return WithReason(result.status(), "DRESSING_BREAKS", arrangement_id);
  }
  return result;
}

absl::StatusOr<v1::DressMeshResponse> DressingsService::DressMesh(const v1::DressMeshRequest& request,
                                                                  const IsCancelled& is_cancelled) const {
  TESSERA_ASSIGN_OR_RETURN(const std::string arrangement, ParseArrangementName(request.arrangement()));
  v1::DressMeshResponse response;
  TESSERA_RETURN_IF_ERROR(RunForCaller(is_cancelled, [&](const RunContext& context) -> absl::Status {
    absl::StatusOr<QuadMesh> mesh = WithReason(
        absl::InvalidArgumentError("a mesh is needed: mesh_sha256 or builtin"), "ARGUMENT_INVALID", "mesh");
    if (request.mesh_case() == v1::DressMeshRequest::kMeshSha256) {
      mesh = ReadUploadedMesh(backend_, request.mesh_sha256());
    } else if (request.mesh_case() == v1::DressMeshRequest::kBuiltin) {
      mesh = BuiltinShape(request.builtin());
    }
    TESSERA_RETURN_IF_ERROR(mesh.status());
    const DressParams params{.seed = request.seed(),
                             .allow_breaks = request.allow_breaks(),
                             .target_quads = request.target_quads()};
    TESSERA_ASSIGN_OR_RETURN(const DressResult result, DressSurface(*mesh, arrangement, params, context));
    TESSERA_ASSIGN_OR_RETURN(const std::string bytes, SerializeDressing(result.dressing));
    TESSERA_ASSIGN_OR_RETURN(const std::string sha256, backend_.blobs.Put(bytes));
    response.mutable_dressing()->set_sha256(sha256);
    response.mutable_dressing()->set_size_bytes(bytes.size());
    response.set_num_quads(static_cast<uint32_t>(result.dressing.mesh.quads.size()));
    response.set_num_breaks(static_cast<uint32_t>(result.breaks.size()));
    return absl::OkStatus();
  }));
  return response;
}

}  // namespace tessera
