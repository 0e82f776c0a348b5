// The service tessera.v1.Dressings, and the surfaces that previews and dressings have in common.
#pragma once

#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/wang/dress.h"
#include "btf/wang/quad_mesh.h"
#include "server/rpc/backend.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Largest mesh file and dressing that the server takes.
inline constexpr uint64_t kMaxMeshBytes = uint64_t{256} << 20;
inline constexpr uint64_t kMaxDressingBytes = uint64_t{1} << 30;

// An uploaded OBJ or OFF; the format is told from the bytes. Errors: NOT_FOUND, INVALID_ARGUMENT
// (FORMAT_INVALID).
[[nodiscard]] absl::StatusOr<QuadMesh> ReadUploadedMesh(const Backend& backend, const std::string& sha256);
// Errors: DressMesh's, with reason DRESSING_BREAKS where tiles cannot match.
[[nodiscard]] absl::StatusOr<DressResult> DressSurface(const QuadMesh& mesh,
                                                       const std::string& arrangement_id,
                                                       const DressParams& params, const RunContext& context);

// Each function is the RPC of its name. Thread-safe.
class DressingsService {
 public:
  explicit DressingsService(const Backend& backend) : backend_(backend) {}

  [[nodiscard]] absl::StatusOr<v1::DressMeshResponse> DressMesh(const v1::DressMeshRequest& request,
                                                                const IsCancelled& is_cancelled) const;

 private:
  const Backend& backend_;
};

}  // namespace tessera
