// The programs of a preview, as text. Semantics: preview_scene.h and surface.h.
//
// The first draws the surface into a buffer of (face, s, q) per sample; the second shades each pixel from its
// four samples, so that the costly decoding runs once a pixel and never on hidden surfaces.
#pragma once

#include <string>

#include "btf/render/preview.h"

namespace tessera {

[[nodiscard]] std::string SurfaceVertexShader();
[[nodiscard]] std::string SurfaceFragmentShader();
// Nothing, as far as can be; drawn over the whole frame by ShadeVertexShader().
[[nodiscard]] std::string EmptySampleFragmentShader();
[[nodiscard]] std::string ShadeVertexShader();
// `codec_source` is CodecGlsl::source.
[[nodiscard]] std::string ShadeFragmentShader(const std::string& codec_source, Filter filter);

}  // namespace tessera
