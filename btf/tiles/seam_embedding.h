// The embedding that seams are laid in: as Codec::Embed gives one, but of what a certificate looks at, the
// pictures of the material from the directions that were measured.
//
// Every picture counts alike: it is divided by the spread of its values, since a seam shows against what the
// picture itself shows. And views are as dense as parallax asks: a texel of a rough surface shows something
// else once its view moves by a feature, which takes a turn of a few degrees at grazing angles and is out of
// reach near the normal. So there are few views near the normal, all of which show much the same, and many at
// the widest angle, each of which a seam must please by itself. With pictures spread by solid angle, as
// Codec::Embed spreads them, seams look best from above and worst from aside.
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"
#include "btf/codec/material.h"

namespace tessera {

// 36 views and 12 lights: rings at parts of the widest polar angle of the material's views and lights.
// Result and errors as of EmbedImages.
[[nodiscard]] absl::StatusOr<Embedding> EmbedForSeams(const Material& material, int dims,
                                                      const RunContext& context);

}  // namespace tessera
