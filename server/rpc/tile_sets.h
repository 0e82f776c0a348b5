// The service tessera.v1.TileSets.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/rpc/backend.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Each function is the RPC of its name. Thread-safe.
class TileSetsService {
 public:
  explicit TileSetsService(const Backend& backend) : backend_(backend) {}

  [[nodiscard]] absl::StatusOr<v1::Job> SynthesizeTileSet(const v1::SynthesizeTileSetRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::Job> CertifyTileSet(const v1::CertifyTileSetRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::TileSet> CreateTileSet(const v1::CreateTileSetRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::TileSet> GetTileSet(const v1::GetTileSetRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::ListTileSetsResponse> ListTileSets(
      const v1::ListTileSetsRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::DeleteTileSetResponse> DeleteTileSet(
      const v1::DeleteTileSetRequest& request) const;

 private:
  [[nodiscard]] absl::StatusOr<v1::TileSet> GetNamed(const std::string& name) const;

  const Backend& backend_;
};

}  // namespace tessera
