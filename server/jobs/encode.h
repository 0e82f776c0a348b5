// What jobs that end in a material have in common: the codec, and the material as their output.
#pragma once

#include <filesystem>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"
#include "btf/data/btf_source.h"
#include "server/jobs/job.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Errors: INVALID_ARGUMENT naming the field, its value and what is legal.
[[nodiscard]] absl::Status CheckEncodeOptions(const v1::EncodeOptions& options);
// What memory does not hold goes to the job's scratch folder. Errors: EncodeModel's.
[[nodiscard]] absl::StatusOr<Material> EncodeSource(BtfSource& source, const v1::EncodeOptions& options,
                                                    const std::filesystem::path& scratch_folder,
                                                    const RunContext& context);
// Messages reach clients: "archive.zip: ..." instead of the folder it lies in.
[[nodiscard]] absl::Status WithoutFolder(const absl::Status& status, const std::filesystem::path& folder);
[[nodiscard]] absl::StatusOr<JobOutput> OutputOfMaterial(const Material& material);

}  // namespace tessera
