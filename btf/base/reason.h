// The stable reason that an error carries beside its sentence, so that programs need not read sentences.
//
// It travels in the payload "tessera.reason" (plain text) of an absl::Status, and what it is about in
// "tessera.subject".
//
//   return WithReason(absl::AlreadyExistsError("materials/wool exists"), "NAME_TAKEN", "materials/wool");
//   if (ReasonOf(status) == "NAME_TAKEN") { ... }
#pragma once

#include <string>
#include <string_view>

#include <absl/status/status.h>

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

}  // namespace tessera
