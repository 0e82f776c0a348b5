// What a preview keeps in GL between pictures, and what one picture is drawn into.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "btf/codec/codec.h"
#include "btf/render/gl_state.h"
#include "btf/render/preview.h"
#include "btf/render/preview_scene.h"
#include "btf/render/shadow_maps.h"
#include "btf/render/surface.h"

namespace tessera {

// A buffer that shaders read through texelFetch.
class BufferTexture {
 public:
  explicit BufferTexture(const GladGLContext& gl) : gl_(gl), buffer_(gl), texture_(gl) {}

  // Errors: RESOURCE_EXHAUSTED naming the table when it has more texels than a buffer texture may.
  template <typename T>
  absl::Status Fill(std::span<const T> values, GLenum format, size_t components, const char* what) {
    GLint most_texels = 0;
    gl_.GetIntegerv(GL_MAX_TEXTURE_BUFFER_SIZE, &most_texels);
    const size_t texels = values.size() / components;
    if (texels == 0 || texels > static_cast<size_t>(most_texels)) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the ", what, " fill ", texels, " texels, expected 1..", most_texels));
    }
    gl_.BindBuffer(GL_TEXTURE_BUFFER, buffer_.name());
    gl_.BufferData(GL_TEXTURE_BUFFER, static_cast<GLsizeiptr>(values.size_bytes()), values.data(),
                   GL_STATIC_DRAW);
    gl_.BindTexture(GL_TEXTURE_BUFFER, texture_.name());
    gl_.TexBuffer(GL_TEXTURE_BUFFER, format, buffer_.name());
    return absl::OkStatus();
  }

  void Bind(int unit) const {
    gl_.ActiveTexture(GL_TEXTURE0 + unit);
    gl_.BindTexture(GL_TEXTURE_BUFFER, texture_.name());
  }

 private:
  const GladGLContext& gl_;
  GlBuffer buffer_;
  GlTexture texture_;
};

// What one band of a picture is drawn into.
struct PreviewTargets {
  explicit PreviewTargets(const GladGLContext& gl)
      : samples(gl), depth(gl), pixels(gl), sample_target(gl), pixel_target(gl) {}

  // Once. The context must be current.
  absl::Status Allocate(const GlState& state, int band_width, int band_rows);

  int width = 0;
  int rows = 0;
  GlTexture samples;  // RGBA32UI, a layer a sample
  GlRenderbuffer depth;
  GlTexture pixels;
  GlFramebuffer sample_target;
  GlFramebuffer pixel_target;
};

// What all pictures of a tile set on a dressing have in common, in GL.
class GlPreview::Resources {
 public:
  Resources(GlState& state, const Dressing& dressing, const TileSet& tile_set, const TileMips* mips)
      : state(state),
        gl(state.gl),
        dressing(dressing),
        tile_set(tile_set),
        mips(mips),
        triangles(TriangulateSurface(dressing.mesh)),
        face_corners(gl),
        face_links(gl),
        tile_index(gl),
        btfel_words(gl),
        codec_values(gl),
        codec_words(gl),
        harmonics_values(gl),
        harmonics_words(gl),
        vertices(gl),
        indices(gl),
        vertex_array(gl),
        no_vertices(gl) {}

  // The context must be current.
  absl::Status Fill(const DressedSurface& surface, const CodecGlsl& codec);
  // What the codec reads under `n` harmonics of light, unless it is there already.
  absl::Status FillHarmonics(int n);

  GlState& state;
  const GladGLContext& gl;
  const Dressing& dressing;
  const TileSet& tile_set;
  const TileMips* mips;
  std::vector<GLint> level_begin;  // in tile_index, of each level from 0 on
  const SurfaceTriangles triangles;
  BufferTexture face_corners;
  BufferTexture face_links;
  BufferTexture tile_index;
  BufferTexture btfel_words;
  BufferTexture codec_values;
  BufferTexture codec_words;
  BufferTexture harmonics_values;
  BufferTexture harmonics_words;
  GlBuffer vertices;
  GlBuffer indices;
  GlVertexArray vertex_array;
  GlVertexArray no_vertices;
  std::string codec_source;
  int num_harmonics = 0;  // of the last picture with light from all around
  std::string harmonics_source;
  std::unique_ptr<PreviewTargets> targets;  // of the last picture
  std::unique_ptr<ShadowMaps> shadow_maps;  // of the last picture with shadows

 private:
  absl::Status FillSurface(const DressedSurface& surface);
  absl::Status FillTexels();
};

}  // namespace tessera
