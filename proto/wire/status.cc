#include "proto/wire/status.h"

#include <utility>

#include <absl/strings/cord.h>
#include <absl/strings/string_view.h>

#include "tessera/v1/tessera.pb.h"

namespace tessera {
namespace {

constexpr std::string_view kReasonUrl = "tessera.reason";
constexpr std::string_view kSubjectUrl = "tessera.subject";

absl::string_view AbslView(std::string_view text) {
  return {text.data(), text.size()};
}

std::string Payload(const absl::Status& status, std::string_view url) {
  const auto payload = status.GetPayload(AbslView(url));
  return payload ? std::string(*payload) : std::string();
}

std::string_view ReasonOfCode(absl::StatusCode code) {
  switch (code) {
    case absl::StatusCode::kOk:
      return "";
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
      return "ARGUMENT_INVALID";
    case absl::StatusCode::kNotFound:
      return "NOT_FOUND";
    case absl::StatusCode::kAlreadyExists:
      return "NAME_TAKEN";
    case absl::StatusCode::kCancelled:
      return "CANCELLED";
    case absl::StatusCode::kDataLoss:
      return "BLOB_CORRUPT";
    case absl::StatusCode::kFailedPrecondition:
      return "PRECONDITION_FAILED";
    case absl::StatusCode::kResourceExhausted:
      return "LIMIT_REACHED";
    case absl::StatusCode::kUnimplemented:
      return "UNSUPPORTED";
    case absl::StatusCode::kAborted:
      return "ABORTED";
    case absl::StatusCode::kUnavailable:
      return "UNAVAILABLE";
    case absl::StatusCode::kDeadlineExceeded:
      return "DEADLINE_EXCEEDED";
    default:
      return "INTERNAL";
  }
}

}  // namespace

absl::Status WithReason(absl::Status status, std::string_view reason, std::string_view subject) {
  if (status.ok()) {
    return status;
  }
  status.SetPayload(AbslView(kReasonUrl), absl::Cord(AbslView(reason)));
  if (!subject.empty()) {
    status.SetPayload(AbslView(kSubjectUrl), absl::Cord(AbslView(subject)));
  }
  return status;
}

std::string ReasonOf(const absl::Status& status) {
  const std::string reason = Payload(status, kReasonUrl);
  return reason.empty() ? std::string(ReasonOfCode(status.code())) : reason;
}

std::string SubjectOf(const absl::Status& status) {
  return Payload(status, kSubjectUrl);
}

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
