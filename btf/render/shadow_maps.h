// Shadow maps of a batch of lights: layers of one depth texture.
#pragma once

#include <span>
#include <vector>

#include <absl/status/status.h>

#include "btf/render/gl_state.h"
#include "btf/render/preview.h"
#include "btf/render/preview_scene.h"
#include "btf/render/shadow_views.h"

namespace tessera {

// The maps of one light: layers first_layer, first_layer + 1, ...
struct LightMaps {
  int first_layer = 0;
  std::vector<ShadowView> views;
};

// The context must be current wherever it is used.
class ShadowMaps {
 public:
  ShadowMaps(GlState& state, int map_size, int num_layers);

  // Once. Errors: INTERNAL (GL), RESOURCE_EXHAUSTED.
  [[nodiscard]] absl::Status Allocate();

  // Enough for all lights where that is not too much memory, else for a batch.
  [[nodiscard]] static int LayersFor(std::span<const Light> lights, const SurfaceTriangles& triangles,
                                     int map_size);

  [[nodiscard]] int map_size() const { return map_size_; }
  [[nodiscard]] int num_layers() const { return num_layers_; }

  // Draws the maps of as many of the first of `lights` as there are layers for, at least one, and returns
  // them. `vertex_array` holds the triangles; `program` is that of ShadowVertexShader().
  [[nodiscard]] std::vector<LightMaps> Draw(std::span<const Light> lights, const SurfaceTriangles& triangles,
                                            GLuint vertex_array, GLuint program);

  void Bind(int unit) const;

 private:
  GlState& state_;
  const GladGLContext& gl_;
  const int map_size_;
  const int num_layers_;
  GlTexture depth_;
  GlFramebuffer target_;
};

}  // namespace tessera
