// The service tessera.v1.TileSets.
#pragma once

#include <functional>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/rpc/backend.h"
#include "server/rpc/tile_set_streams.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Each function is the RPC of its name. Thread-safe.
class TileSetsService {
 public:
  explicit TileSetsService(const Backend& backend) : backend_(backend), streams_(backend.blobs) {}

  [[nodiscard]] absl::StatusOr<v1::Job> SynthesizeTileSet(const v1::SynthesizeTileSetRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::Job> CertifyTileSet(const v1::CertifyTileSetRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::TileSet> CreateTileSet(const v1::CreateTileSetRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::TileSet> GetTileSet(const v1::GetTileSetRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::ListTileSetsResponse> ListTileSets(
      const v1::ListTileSetsRequest& request) const;
  [[nodiscard]] absl::StatusOr<v1::DeleteTileSetResponse> DeleteTileSet(
      const v1::DeleteTileSetRequest& request) const;
  // `write` is false once the caller is gone.
  [[nodiscard]] absl::Status StreamTileSet(const v1::StreamTileSetRequest& request,
                                           const IsCancelled& is_cancelled,
                                           const std::function<bool(const v1::TileSetChunk&)>& write);

 private:
  [[nodiscard]] absl::StatusOr<v1::TileSet> GetNamed(const std::string& name) const;

  const Backend& backend_;
  TileSetStreams streams_;
};

}  // namespace tessera
