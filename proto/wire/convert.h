// Domain values <-> messages of tessera.v1. Degrees exist in messages only.
#pragma once

#include <string>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/choice/encode_model.h"
#include "btf/data/btf_source.h"
#include "btf/image/tone_map.h"
#include "btf/math/conventions.h"
#include "btf/render/preview.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/tile_set.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

[[nodiscard]] v1::Direction MessageFromDirection(const Direction& direction);
[[nodiscard]] Direction DirectionFromMessage(const v1::Direction& message);

[[nodiscard]] v1::Provenance MessageFromProvenance(const Provenance& provenance);
[[nodiscard]] Provenance ProvenanceFromMessage(const v1::Provenance& message);

[[nodiscard]] v1::Arrangement MessageFromArrangement(const Arrangement& arrangement);
// The arrangement as the server sent it; its id is the name's.
// Errors: INVALID_ARGUMENT (name, codes that do not exist with its colours or that the listing's SHA-256 does
// not match).
[[nodiscard]] absl::StatusOr<Arrangement> ArrangementFromMessage(const v1::Arrangement& message);

[[nodiscard]] v1::JobProgress MessageFromProgress(const Progress& progress);

// What a catalog tells of a container: every field but name, blob and create_time.
[[nodiscard]] v1::Material MessageFromMaterial(const Material& material);
[[nodiscard]] v1::TileSet MessageFromTileSet(const TileSet& tile_set);

// With defaults for what is 0 or empty. What the codec then is and takes, CheckModelRequest and the codec
// know. Errors: INVALID_ARGUMENT naming cls_energy or scene_light and its legal values, or a number out of
// all range.
[[nodiscard]] absl::StatusOr<ModelRequest> ModelRequestFromMessage(const v1::EncodeOptions& message);
// Defaults for what is 0 or empty, so that equal requests become equal bytes.
void FillDefaults(v1::EncodeOptions& message);

// An irradiance of 0, 0, 0 means pi in each channel.
[[nodiscard]] Light LightFromMessage(const v1::Light& message);
[[nodiscard]] v1::Light MessageFromLight(const Light& light);
// A field of view of 0 means 35 degrees, up of 0, 0, 0 the y axis.
[[nodiscard]] Camera CameraFromMessage(const v1::Camera& message);
[[nodiscard]] v1::Camera MessageFromCamera(const Camera& camera);
// A distance of 0 means 1, a field of view of 0 means 35 degrees.
[[nodiscard]] Orbit OrbitFromMessage(const v1::Orbit& message);
// A white of 0 means 4. Errors: INVALID_ARGUMENT (a curve that does not exist).
[[nodiscard]] absl::StatusOr<Tone> ToneFromMessage(const v1::Tone& message);

}  // namespace tessera
