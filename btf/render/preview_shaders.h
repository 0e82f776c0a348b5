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
// The whole frame, at the largest depth.
[[nodiscard]] std::string FrameVertexShader();
// Nothing; drawn over the whole frame.
[[nodiscard]] std::string EmptySampleFragmentShader();
// Depth alone, from a light.
[[nodiscard]] std::string ShadowVertexShader();
[[nodiscard]] std::string ShadowFragmentShader();

struct ShadeVariant {
  Filter filter = Filter::kBilinear;
  bool has_mips = false;  // levels stand behind the tile set's texels
  bool has_shadows = false;
  int num_harmonics = 0;  // of light from all around, in which there are no shadows; 0: one light
};
// `codec_source` is CodecGlsl::source, or HarmonicsGlsl::source for that number.
[[nodiscard]] std::string ShadeFragmentShader(const std::string& codec_source, const ShadeVariant& variant);

}  // namespace tessera
