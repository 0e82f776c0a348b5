// What jobs that end in a material have in common: the codec, and the material as their output.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"
#include "btf/data/btf_source.h"
#include "server/jobs/job.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Errors: INVALID_ARGUMENT naming the codec, or cls_energy, and the legal values.
[[nodiscard]] absl::Status CheckEncodeOptions(const v1::EncodeOptions& options);
// Errors: the codec's.
[[nodiscard]] absl::StatusOr<Material> EncodeSource(BtfSource& source, const v1::EncodeOptions& options,
                                                    const RunContext& context);
[[nodiscard]] absl::StatusOr<JobOutput> OutputOfMaterial(const Material& material);

}  // namespace tessera
