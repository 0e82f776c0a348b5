// Errors of uploaded bytes that are not what they were declared to be.
#pragma once

#include <string_view>

#include <absl/status/status.h>

namespace tessera {

// `status` of a parser with reason FORMAT_INVALID and the blob as subject. Its code becomes INVALID_ARGUMENT
// (the bytes are as uploaded, so a broken checksum is the caller's too) unless it is UNIMPLEMENTED: a version
// this server lacks.
[[nodiscard]] absl::Status FormatInvalid(const absl::Status& status, std::string_view sha256);

}  // namespace tessera
