// Job kind "synthesize": a material becomes a tile set in an arrangement.
//
// Parameters: SynthesizeTileSetRequest of which name is "arrangements/A" and material, replace and request_id
// are empty. Inputs: the material's container.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/wang/arrangement.h"
#include "server/jobs/job.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Key of a tile set's metadata: the digest of the container of the material it was made of.
inline constexpr char kMaterialDigestKey[] = "material_sha256";

// What can be refused before the job is queued, of a request for this arrangement. Errors: INVALID_ARGUMENT
// naming the field and its legal values, or the recipe's key.
[[nodiscard]] absl::Status CheckSynthesizeRequest(const v1::SynthesizeTileSetRequest& request,
                                                  const Arrangement& arrangement);
// Defaults for what is 0 or empty, and one spelling of a recipe, so that equal requests become equal bytes.
void FillDefaults(v1::SynthesizeTileSetRequest& request);
// Errors: ParseMaterial's and SynthesizeTileSet's.
[[nodiscard]] absl::StatusOr<JobOutput> RunSynthesizeJob(const JobInput& input, const JobContext& context);

}  // namespace tessera
