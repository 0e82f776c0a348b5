// The service tessera.v1.ServerInfo.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "server/rpc/backend.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Each function is the RPC of its name. Thread-safe.
class ServerInfoService {
 public:
  ServerInfoService(const Backend& backend, int num_workers)
      : backend_(backend), num_workers_(num_workers), start_ms_(backend.clock()) {}

  [[nodiscard]] absl::StatusOr<v1::ServerStatus> GetServerStatus(
      const v1::GetServerStatusRequest& request) const;

 private:
  const Backend& backend_;
  const int num_workers_;
  const int64_t start_ms_;
};

}  // namespace tessera
