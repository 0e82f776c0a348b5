// absl::Status <-> grpc::Status, the one conversion pair.
//
// Inside the program the stable reason of an error and its subject are payloads (btf/base/reason.h); on the
// wire both are an ErrorDetail inside an RpcStatus, whose bytes are the `grpc-status-details-bin` trailer.
#pragma once

#include <absl/status/status.h>
#include <grpcpp/support/status.h>

#include "btf/base/reason.h"  // IWYU pragma: export

namespace tessera {

// Code and message are kept; the result always carries an ErrorDetail unless it is OK.
[[nodiscard]] grpc::Status GrpcFromStatus(const absl::Status& status);
// Code and message are kept; reason and subject come back as payloads. Details that cannot be parsed are
// ignored: a status may come from gRPC itself or from a proxy.
[[nodiscard]] absl::Status StatusFromGrpc(const grpc::Status& status);

}  // namespace tessera
