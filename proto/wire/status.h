// absl::Status <-> grpc::Status, the one conversion pair, and the stable reason that errors carry.
//
// Inside the program a reason travels in the payload "tessera.reason" (plain text) of an absl::Status, its
// subject in "tessera.subject"; on the wire both are an ErrorDetail inside an RpcStatus, whose bytes are the
// `grpc-status-details-bin` trailer.
//
//   return WithReason(absl::AlreadyExistsError("materials/wool exists"), "NAME_TAKEN", "materials/wool");
//   if (ReasonOf(status) == "NAME_TAKEN") { ... }
#pragma once

#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <grpcpp/support/status.h>

namespace tessera {

// `status` with the reason, and the subject unless it is empty. An OK status is returned as it is.
[[nodiscard]] absl::Status WithReason(absl::Status status, std::string_view reason,
                                      std::string_view subject = {});

// The reason that `status` carries, or the one that its code stands for (INVALID_ARGUMENT and OUT_OF_RANGE:
// ARGUMENT_INVALID, ALREADY_EXISTS: NAME_TAKEN, DATA_LOSS: BLOB_CORRUPT, FAILED_PRECONDITION:
// PRECONDITION_FAILED, RESOURCE_EXHAUSTED: LIMIT_REACHED, UNIMPLEMENTED: UNSUPPORTED; NOT_FOUND, CANCELLED,
// ABORTED, UNAVAILABLE and DEADLINE_EXCEEDED: themselves; others: INTERNAL). Empty for OK.
[[nodiscard]] std::string ReasonOf(const absl::Status& status);
// The subject that `status` carries; empty when none.
[[nodiscard]] std::string SubjectOf(const absl::Status& status);

// Code and message are kept; the result always carries an ErrorDetail unless it is OK.
[[nodiscard]] grpc::Status GrpcFromStatus(const absl::Status& status);
// Code and message are kept; reason and subject come back as payloads. Details that cannot be parsed are
// ignored: a status may come from gRPC itself or from a proxy.
[[nodiscard]] absl::Status StatusFromGrpc(const grpc::Status& status);

}  // namespace tessera
