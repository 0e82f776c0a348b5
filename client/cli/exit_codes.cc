#include "client/cli/exit_codes.h"

#include <absl/strings/cord.h>
#include <absl/types/optional.h>

#include "client/lib/client.h"

namespace tessera::cli {
namespace {

constexpr absl::string_view kUsagePayload = "tessera.usage";

}  // namespace

absl::Status UsageError(absl::string_view message) {
  absl::Status status = absl::InvalidArgumentError(message);
  status.SetPayload(kUsagePayload, absl::Cord("1"));
  return status;
}

ExitCode ExitCodeOf(const absl::Status& status) {
  if (status.ok()) {
    return kExitOk;
  }
  if (status.GetPayload(kUsagePayload).has_value()) {
    return kExitUsage;
  }
  if (!FailedJob(status).empty()) {
    return kExitJobFailed;
  }
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
      return kExitNoServer;
    case absl::StatusCode::kNotFound:
      return kExitNotFound;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kOutOfRange:
    case absl::StatusCode::kAlreadyExists:
    case absl::StatusCode::kFailedPrecondition:
    case absl::StatusCode::kUnimplemented:
    case absl::StatusCode::kDataLoss:
      return kExitRefused;
    case absl::StatusCode::kCancelled:
      return kExitInterrupted;
    default:
      return kExitFailure;
  }
}

}  // namespace tessera::cli
