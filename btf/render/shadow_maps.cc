#include "btf/render/shadow_maps.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

// Of all maps held at once; those of one light must find room.
constexpr int kMostTexels = 1 << 25;
constexpr int kMostLayers = 64;

}  // namespace

int ShadowMaps::LayersFor(std::span<const Light> lights, const SurfaceTriangles& triangles, int map_size) {
  size_t wanted = 0;
  for (const Light& light : lights) {
    wanted += ShadowViewsOf(light, triangles, map_size).size();
  }
  const int most = std::clamp(kMostTexels / (map_size * map_size), kMostMapsPerLight, kMostLayers);
  return static_cast<int>(std::clamp<size_t>(wanted, 1, most));
}

ShadowMaps::ShadowMaps(GlState& state, int map_size, int num_layers)
    : state_(state), gl_(state.gl), map_size_(map_size), num_layers_(num_layers), depth_(gl_), target_(gl_) {}

absl::Status ShadowMaps::Allocate() {
  gl_.BindTexture(GL_TEXTURE_2D_ARRAY, depth_.name());
  gl_.TexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_DEPTH_COMPONENT32F, map_size_, map_size_, num_layers_);
  const auto set = [&](GLenum name, GLint value) { gl_.TexParameteri(GL_TEXTURE_2D_ARRAY, name, value); };
  // The share of 2 x 2 texels that are not nearer to the light.
  set(GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  set(GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  set(GL_TEXTURE_COMPARE_MODE, GL_COMPARE_REF_TO_TEXTURE);
  set(GL_TEXTURE_COMPARE_FUNC, GL_LEQUAL);
  set(GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  set(GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  gl_.BindFramebuffer(GL_FRAMEBUFFER, target_.name());
  gl_.DrawBuffer(GL_NONE);
  gl_.FramebufferTextureLayer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, depth_.name(), 0, 0);
  if (gl_.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    return absl::InternalError("GL offers no framebuffer of depth alone");
  }
  return state_.CheckError("shadow maps");
}

std::vector<LightMaps> ShadowMaps::Draw(std::span<const Light> lights, const SurfaceTriangles& triangles,
                                        GLuint vertex_array, GLuint program) {
  gl_.BindFramebuffer(GL_FRAMEBUFFER, target_.name());
  gl_.Viewport(0, 0, map_size_, map_size_);
  gl_.Disable(GL_SCISSOR_TEST);
  gl_.Disable(GL_BLEND);
  gl_.Disable(GL_CULL_FACE);
  gl_.Enable(GL_DEPTH_TEST);
  gl_.DepthMask(GL_TRUE);
  gl_.DepthFunc(GL_LESS);
  gl_.UseProgram(program);
  gl_.BindVertexArray(vertex_array);
  const GLint matrix = gl_.GetUniformLocation(program, "clip_from_surface");
  std::vector<LightMaps> drawn;
  int layer = 0;
  for (const Light& light : lights) {
    LightMaps maps{.first_layer = layer, .views = ShadowViewsOf(light, triangles, map_size_)};
    if (layer + static_cast<int>(maps.views.size()) > num_layers_) {
      break;
    }
    for (const ShadowView& view : maps.views) {
      gl_.FramebufferTextureLayer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, depth_.name(), 0, layer++);
      gl_.Clear(GL_DEPTH_BUFFER_BIT);
      const Eigen::Matrix4f clip_from_surface = view.clip_from_surface.cast<float>();
      gl_.UniformMatrix4fv(matrix, 1, GL_FALSE, clip_from_surface.data());
      gl_.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(triangles.indices.size()), GL_UNSIGNED_INT,
                       nullptr);
    }
    drawn.push_back(std::move(maps));
  }
  return drawn;
}

void ShadowMaps::Bind(int unit) const {
  gl_.ActiveTexture(GL_TEXTURE0 + unit);
  gl_.BindTexture(GL_TEXTURE_2D_ARRAY, depth_.name());
}

}  // namespace tessera
