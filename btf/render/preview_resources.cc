#include "btf/render/preview_resources.h"

#include <bit>
#include <cstddef>
#include <utility>

#include "btf/base/status_macros.h"

namespace tessera {

absl::Status PreviewTargets::Allocate(const GlState& state, int band_width, int band_rows) {
  const GladGLContext& gl = state.gl;
  width = band_width;
  rows = band_rows;
  gl.BindTexture(GL_TEXTURE_2D_ARRAY, samples.name());
  gl.TexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_RGBA32UI, width, rows, kSamplesPerPixel);
  gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  gl.BindRenderbuffer(GL_RENDERBUFFER, depth.name());
  gl.RenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT32F, width, rows);
  gl.BindTexture(GL_TEXTURE_2D, pixels.name());
  gl.TexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA32F, width, rows);

  gl.BindFramebuffer(GL_FRAMEBUFFER, pixel_target.name());
  gl.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, pixels.name(), 0);
  if (gl.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    return absl::InternalError("GL offers no RGBA32F framebuffer");
  }
  gl.BindFramebuffer(GL_FRAMEBUFFER, sample_target.name());
  gl.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth.name());
  gl.FramebufferTextureLayer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, samples.name(), 0, 0);
  if (gl.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    return absl::InternalError("GL offers no RGBA32UI framebuffer with depth");
  }
  return state.CheckError("framebuffers");
}

absl::Status GlPreview::Resources::FillSurface(const DressedSurface& surface) {
  const QuadMesh& mesh = dressing.mesh;
  std::vector<float> corners;
  corners.reserve(mesh.quads.size() * 32);
  for (const Quad& quad : mesh.quads) {
    for (const uint32_t vertex : quad) {
      const Eigen::Vector3d p = mesh.positions[vertex].cast<double>() - triangles.centre;
      for (int i = 0; i < 3; ++i) {
        corners.push_back(static_cast<float>(p[i]));
      }
      corners.push_back(1.0f);
    }
    for (const uint32_t vertex : quad) {
      const Eigen::Vector3f& n = mesh.normals[vertex];
      corners.insert(corners.end(), {n.x(), n.y(), n.z(), 0.0f});
    }
  }
  TESSERA_RETURN_IF_ERROR(
      face_corners.Fill(std::span<const float>(corners), GL_RGBA32F, 4, "corners of the mesh"));

  std::vector<int32_t> links;
  links.reserve(mesh.quads.size() * 8);
  for (size_t f = 0; f < mesh.quads.size(); ++f) {
    int32_t sides = 0;
    int32_t turns = 0;
    for (int k = 0; k < 4; ++k) {
      const TileNeighbour& neighbour = surface.neighbours()[f][k];
      links.push_back(neighbour.face);
      sides |= static_cast<int32_t>(neighbour.side) << (2 * k);
      turns |= static_cast<int32_t>(neighbour.turns) << (2 * k);
    }
    links.insert(links.end(), {static_cast<int32_t>(dressing.tile[f]),
                               static_cast<int32_t>(dressing.turns[f]), sides, turns});
  }
  TESSERA_RETURN_IF_ERROR(
      face_links.Fill(std::span<const int32_t>(links), GL_RGBA32I, 4, "links of the mesh"));
  return FillTexels();
}

absl::Status GlPreview::Resources::FillTexels() {
  if (mips == nullptr) {
    return tile_index.Fill(std::span<const uint32_t>(tile_set.tile_index), GL_R32UI, 1, "tiles' texels");
  }
  // A texel or a part of one, then its weight; BTFels numbered on from level to level.
  std::vector<uint32_t> parts;
  const auto add = [&parts](uint32_t texel, float weight) {
    parts.insert(parts.end(), {texel, std::bit_cast<uint32_t>(weight)});
  };
  level_begin = {0};
  for (const uint32_t texel : tile_set.tile_index) {
    add(texel, 1.0F);
  }
  uint64_t first_btfel = tile_set.btfels.size();
  for (const MipLevel& level : mips->levels) {
    level_begin.push_back(static_cast<GLint>(parts.size() / 2));
    for (const MipPart& part : level.parts) {
      add(PackTexel(static_cast<uint32_t>(first_btfel) + BtfelOfTexel(part.texel), TurnsOfTexel(part.texel)),
          part.weight);
    }
    first_btfel += level.btfels.size();
  }
  if (first_btfel > BtfelOfTexel(~0U)) {
    return absl::ResourceExhaustedError(
        absl::StrCat(first_btfel, " BTFels with mip levels, at most ", BtfelOfTexel(~0U)));
  }
  return tile_index.Fill(std::span<const uint32_t>(parts), GL_RG32UI, 2, "tiles' texels");
}

absl::Status GlPreview::Resources::Fill(const DressedSurface& surface, const CodecGlsl& codec) {
  codec_source = codec.source;
  TESSERA_RETURN_IF_ERROR(FillSurface(surface));
  TESSERA_RETURN_IF_ERROR(
      btfel_words.Fill(std::span<const uint32_t>(codec.btfel_words), GL_RGBA32UI, 4, "BTFels"));
  TESSERA_RETURN_IF_ERROR(
      codec_values.Fill(std::span<const float>(codec.shared_values), GL_RGBA32F, 4, "codec's tables"));
  if (!codec.shared_words.empty()) {
    TESSERA_RETURN_IF_ERROR(codec_words.Fill(std::span<const uint32_t>(codec.shared_words), GL_RGBA32UI, 4,
                                             "codec's packed tables"));
  }

  gl.BindVertexArray(vertex_array.name());
  gl.BindBuffer(GL_ARRAY_BUFFER, vertices.name());
  gl.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles.vertices.size() * sizeof(SurfaceVertex)),
                triangles.vertices.data(), GL_STATIC_DRAW);
  gl.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices.name());
  gl.BufferData(GL_ELEMENT_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles.indices.size() * sizeof(uint32_t)),
                triangles.indices.data(), GL_STATIC_DRAW);
  const auto offset = [](size_t bytes) { return reinterpret_cast<const void*>(bytes); };
  constexpr GLsizei kStride = sizeof(SurfaceVertex);
  gl.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, kStride, offset(offsetof(SurfaceVertex, position)));
  gl.VertexAttribPointer(1, 2, GL_FLOAT, GL_FALSE, kStride, offset(offsetof(SurfaceVertex, st)));
  gl.VertexAttribIPointer(2, 1, GL_UNSIGNED_INT, kStride, offset(offsetof(SurfaceVertex, face)));
  for (GLuint i = 0; i < 3; ++i) {
    gl.EnableVertexAttribArray(i);
  }
  return state.CheckError("buffers");
}

absl::Status GlPreview::Resources::FillHarmonics(int n) {
  if (n == num_harmonics) {
    return absl::OkStatus();
  }
  std::vector<const BtfelTable*> levels;
  if (mips != nullptr) {
    for (const MipLevel& level : mips->levels) {
      levels.push_back(&level.btfels);
    }
  }
  TESSERA_ASSIGN_OR_RETURN(const HarmonicsGlsl glsl,
                           FindCodec(tile_set.btfels.codec_id)->GlslOfHarmonics(tile_set.btfels, levels, n));
  num_harmonics = 0;
  if (!glsl.values.empty()) {
    TESSERA_RETURN_IF_ERROR(harmonics_values.Fill(std::span<const float>(glsl.values), GL_RGBA32F, 4,
                                                  "codec's tables under harmonics of light"));
  }
  if (!glsl.words.empty()) {
    TESSERA_RETURN_IF_ERROR(harmonics_words.Fill(std::span<const uint32_t>(glsl.words), GL_RGBA32UI, 4,
                                                 "codec's packed tables under harmonics of light"));
  }
  harmonics_source = glsl.source;
  num_harmonics = n;
  return absl::OkStatus();
}

}  // namespace tessera
