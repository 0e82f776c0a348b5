// The service tessera.v1.Materials.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/rpc/backend.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Each function is the RPC of its name. Thread-safe.
class MaterialsService {
 public:
  explicit MaterialsService(const Backend& backend) : backend_(backend) {}

  [[nodiscard]] absl::StatusOr<v1::Material> CreateMaterial(const v1::CreateMaterialRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::Job> ImportMaterial(const v1::ImportMaterialRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::Job> GenerateMaterial(const v1::GenerateMaterialRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::Material> GetMaterial(const v1::GetMaterialRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::ListMaterialsResponse> ListMaterials(
      const v1::ListMaterialsRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::DeleteMaterialResponse> DeleteMaterial(
      const v1::DeleteMaterialRequest& request) const;

 private:
  const Backend& backend_;
};

}  // namespace tessera
