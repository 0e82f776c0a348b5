#include "server/rpc/server_info.h"

#include <algorithm>

#include "btf/base/status_macros.h"

namespace tessera {

absl::StatusOr<v1::ServerStatus> ServerInfoService::GetServerStatus(const v1::GetServerStatusRequest&) const {
  v1::ServerStatus response;
  response.set_version(TESSERA_VERSION);
  response.set_num_workers(static_cast<uint32_t>(num_workers_));
  response.set_uptime_s(static_cast<uint64_t>(std::max<int64_t>(0, backend_.clock() - start_ms_) / 1000));
  TESSERA_RETURN_IF_ERROR(
      backend_.connections.Read([&](Database& db) -> absl::Status { return FillCounts(db, response); }));
  return response;
}

}  // namespace tessera
