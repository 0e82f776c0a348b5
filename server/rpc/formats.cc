#include "server/rpc/formats.h"

#include "proto/wire/status.h"

namespace tessera {

absl::Status FormatInvalid(const absl::Status& status, std::string_view sha256) {
  const bool unknown_version = status.code() == absl::StatusCode::kUnimplemented;
  return WithReason(unknown_version ? status : absl::InvalidArgumentError(status.message()), "FORMAT_INVALID",
                    sha256);
}

}  // namespace tessera
