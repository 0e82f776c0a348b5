#include "btf/base/reason.h"

#include <absl/strings/cord.h>
#include <absl/strings/string_view.h>

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

}  // namespace tessera
