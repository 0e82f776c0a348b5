// Job kind "generate": a BTF traced from a procedural or uploaded height field becomes a material.
//
// Parameters: GenerateMaterialRequest without name, replace and request_id. Inputs: for "heightmap" the
// images that the request names, in the order height, colour, roughness.
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/jobs/job.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// What can be refused before the job is queued. Errors: INVALID_ARGUMENT naming the field and its legal
// values.
[[nodiscard]] absl::Status CheckGenerateRequest(const v1::GenerateMaterialRequest& request);
// The images the request names, in their order.
[[nodiscard]] std::vector<std::string> GenerateInputs(const v1::GenerateMaterialRequest& request);
// Defaults for what is 0 or empty, so that equal requests become equal bytes.
void FillDefaults(v1::GenerateMaterialRequest& request);
// Errors: GenerateBtf's and Encode's.
[[nodiscard]] absl::StatusOr<JobOutput> RunGenerateJob(const JobInput& input, const JobContext& context);

}  // namespace tessera
