// Job kind "certify": the certificate of a tile set is measured again, by other images than its synthesis
// took.
//
// Parameters: CertifyTileSetRequest of which name and request_id are empty. Inputs: the containers of the
// material that the set was made of, and of the set. The result is the same set with the new certificate.
#pragma once

#include <string_view>

#include <absl/status/statusor.h>

#include "server/jobs/job.h"

namespace tessera {

inline constexpr std::string_view kCertifyKind = "certify";

// Errors: those of the parsers and of CertifyTileSet.
[[nodiscard]] absl::StatusOr<JobOutput> RunCertifyJob(const JobInput& input, const JobContext& context);

}  // namespace tessera
