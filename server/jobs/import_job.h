// Job kind "import": an uploaded archive (zip, manifest archive or multi-part EXR) becomes a material.
//
// Parameters: ImportMaterialRequest of which layout, transfer, encode and provenance are read. Inputs: the
// archive.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/jobs/job.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// What can be refused before the job is queued. Errors: INVALID_ARGUMENT naming the field and its legal
// values.
[[nodiscard]] absl::Status CheckImportRequest(const v1::ImportMaterialRequest& request);
// Errors: ImportBtf's and Encode's; no message holds the scratch folder's path.
[[nodiscard]] absl::StatusOr<JobOutput> RunImportJob(const JobInput& input, const JobContext& context);

}  // namespace tessera
