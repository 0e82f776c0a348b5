// The double-precision picture with what tests need beside it.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/light/environment.h"
#include "btf/light/environment_reference.h"
#include "btf/render/preview.h"

namespace tessera {

struct ReferencePicture {
  Image image;
  // [height][width], depth along the view axis of the nearest and the farthest sample of each pixel; infinity
  // where a sample sees nothing. Silhouettes are where these jump.
  std::vector<double> nearest;
  std::vector<double> farthest;
  // [height][width], bit i: light i < 64 reaches some group, or every group, of the pixel. Edges of shadows
  // are where these change, or differ.
  std::vector<uint64_t> lit_somewhere;
  std::vector<uint64_t> lit_everywhere;
};

// Light from all around beside the scene's lights, by brute force: each texel is a directional light from its
// centre, of its radiance times its solid angle, shadowed as the scene's lights are.
struct ReferenceEnvironment {
  const Environment* environment = nullptr;  // or none
  NegativeValues negative_values = NegativeValues::kClamp;
};

// Errors as RenderReference. Cost: with an environment, a decode for each pixel and texel above its horizon.
[[nodiscard]] absl::StatusOr<ReferencePicture> RenderReferenceWithDepth(
    const PreviewScene& scene, const RunContext& context, const ReferenceEnvironment& environment = {});

}  // namespace tessera
