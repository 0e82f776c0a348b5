#include "proto/wire/status.h"

#include <string>
#include <utility>

#include "tessera/v1/tessera.pb.h"

namespace tessera {
grpc::Status GrpcFromStatus(const absl::Status& status) {
  if (status.ok()) {
    return grpc::Status::OK;
  }
  v1::ErrorDetail detail;
  detail.set_reason(ReasonOf(status));
  detail.set_subject(SubjectOf(status));
  v1::RpcStatus rpc_status;
  rpc_status.set_code(static_cast<int>(status.code()));
  rpc_status.set_message(std::string(status.message()));
  rpc_status.add_details()->PackFrom(detail);
  // absl::StatusCode and grpc::StatusCode are both the canonical codes.
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), std::string(status.message()),
                      rpc_status.SerializeAsString());
}

absl::Status StatusFromGrpc(const grpc::Status& status) {
  if (status.ok()) {
    return absl::OkStatus();
  }
  absl::Status result(static_cast<absl::StatusCode>(status.error_code()), status.error_message());
  v1::RpcStatus rpc_status;
  if (!rpc_status.ParseFromString(status.error_details())) {
    return result;
  }
  for (const auto& any : rpc_status.details()) {
    v1::ErrorDetail detail;
    if (any.Is<v1::ErrorDetail>() && any.UnpackTo(&detail)) {
      return WithReason(std::move(result), detail.reason(), detail.subject());
    }
  }
  return result;
}

}  // namespace tessera
