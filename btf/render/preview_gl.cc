#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <absl/memory/memory.h>
#include <absl/strings/str_cat.h>
#include <glm/ext/matrix_clip_space.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/render/gl_state.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "btf/render/preview_scene.h"
#include "btf/render/preview_shaders.h"
#include "btf/render/surface.h"

namespace tessera {
namespace {

// Pixels whose samples are held at once (64 bytes each), and pixels shaded between two looks at the stop
// token: about a third of a second on two cores.
constexpr int kBandPixels = 1 << 20;
constexpr int kStripPixels = 1 << 18;

glm::vec3 GlmFromEigen(const Eigen::Vector3d& v) {
  return glm::vec3(v.x(), v.y(), v.z());
}

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
struct Targets {
  explicit Targets(const GladGLContext& gl)
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

absl::Status Targets::Allocate(const GlState& state, int band_width, int band_rows) {
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

}  // namespace

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
        vertices(gl),
        indices(gl),
        vertex_array(gl),
        no_vertices(gl) {}

  // The context must be current.
  absl::Status Fill(const DressedSurface& surface, const CodecGlsl& codec);

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
  GlBuffer vertices;
  GlBuffer indices;
  GlVertexArray vertex_array;
  GlVertexArray no_vertices;
  std::string codec_source;
  std::unique_ptr<Targets> targets;  // of the last picture

 private:
  absl::Status FillSurface(const DressedSurface& surface);
  absl::Status FillTexels();
};

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

namespace {

// One picture: its targets and the draws.
class PreviewDrawing {
 public:
  PreviewDrawing(GlPreview::Resources& resources, const PreviewScene& scene)
      : resources_(resources),
        gl_(resources.gl),
        scene_(scene),
        view_(MakeViewFrame(scene.camera, resources.triangles)) {}

  absl::StatusOr<Image> Draw(const RunContext& context);

 private:
  void DrawSamples(int first_row, int rows);
  void Shade(const Light& light, bool is_first, int first_row, int num_rows);

  GlPreview::Resources& resources_;
  const GladGLContext& gl_;
  const PreviewScene& scene_;
  const ViewFrame view_;
  GLuint empty_program_ = 0;
  GLuint surface_program_ = 0;
  GLuint shade_program_ = 0;
};

void PreviewDrawing::DrawSamples(int first_row, int rows) {
  gl_.BindFramebuffer(GL_FRAMEBUFFER, resources_.targets->sample_target.name());
  // Row 0 of the framebuffer is the picture's top row: y is turned over, and so is the winding.
  gl_.Viewport(0, -first_row, scene_.width, scene_.height);
  gl_.Disable(GL_SCISSOR_TEST);
  gl_.Disable(GL_BLEND);
  gl_.Disable(GL_CULL_FACE);
  gl_.Enable(GL_DEPTH_TEST);
  gl_.FrontFace(GL_CW);

  const Eigen::Vector3d eye = view_.eye - resources_.triangles.centre;
  glm::dmat4 view(1.0);
  const auto set_row = [&](int row, const Eigen::Vector3d& axis) {
    for (int column = 0; column < 3; ++column) {
      view[column][row] = axis[column];
    }
    view[3][row] = -axis.dot(eye);
  };
  set_row(0, view_.right);
  set_row(1, view_.up);
  set_row(2, view_.back);
  glm::dmat4 clip_from_view =
      glm::perspective(2.0 * std::atan(view_.tan_half_fov_y),
                       static_cast<double>(scene_.width) / scene_.height, view_.near, view_.far);
  for (int column = 0; column < 4; ++column) {
    clip_from_view[column][1] = -clip_from_view[column][1];
  }
  const glm::mat4 clip_from_surface(clip_from_view * view);
  gl_.UseProgram(surface_program_);
  gl_.UniformMatrix4fv(gl_.GetUniformLocation(surface_program_, "clip_from_surface"), 1, GL_FALSE,
                       &clip_from_surface[0][0]);
  const GLint shift = gl_.GetUniformLocation(surface_program_, "sample_shift");
  for (int sample = 0; sample < kSamplesPerPixel; ++sample) {
    gl_.FramebufferTextureLayer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, resources_.targets->samples.name(), 0,
                                sample);
    gl_.DepthMask(GL_TRUE);
    gl_.DepthFunc(GL_LESS);
    gl_.Clear(GL_DEPTH_BUFFER_BIT);
    gl_.UseProgram(surface_program_);
    gl_.BindVertexArray(resources_.vertex_array.name());
    // The pixel centre takes the sample's place when the surface moves the other way.
    gl_.Uniform2f(shift, static_cast<float>(-2.0 * kSampleOffsets[sample][0] / scene_.width),
                  static_cast<float>(-2.0 * kSampleOffsets[sample][1] / scene_.height));
    gl_.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(resources_.triangles.indices.size()), GL_UNSIGNED_INT,
                     nullptr);
    // Samples that nothing covers are drawn afterwards rather than all cleared before: llvmpipe clears texels
    // of 16 bytes one by one.
    gl_.DepthMask(GL_FALSE);
    gl_.DepthFunc(GL_LEQUAL);
    gl_.UseProgram(empty_program_);
    gl_.BindVertexArray(resources_.no_vertices.name());
    gl_.DrawArrays(GL_TRIANGLES, 0, 3);
  }
  gl_.BindFramebuffer(GL_FRAMEBUFFER, resources_.targets->pixel_target.name());
  gl_.Viewport(0, 0, scene_.width, rows);
}

void PreviewDrawing::Shade(const Light& light, bool is_first, int first_row, int num_rows) {
  gl_.Disable(GL_DEPTH_TEST);
  gl_.Enable(GL_SCISSOR_TEST);
  gl_.Scissor(0, first_row, scene_.width, num_rows);
  // Lights add up; alpha is the same from each.
  if (is_first) {
    gl_.Disable(GL_BLEND);
  } else {
    gl_.Enable(GL_BLEND);
  }
  gl_.BlendFuncSeparate(GL_ONE, GL_ONE, GL_ONE, GL_ZERO);
  gl_.UseProgram(shade_program_);
  gl_.BindVertexArray(resources_.no_vertices.name());
  gl_.ActiveTexture(GL_TEXTURE0);
  gl_.BindTexture(GL_TEXTURE_2D_ARRAY, resources_.targets->samples.name());
  int unit = 0;
  const auto set_unit = [&](const char* name) {
    gl_.Uniform1i(gl_.GetUniformLocation(shade_program_, name), unit);
  };
  set_unit("surface_samples");
  const auto bind = [&](const BufferTexture& texture, const char* name) {
    ++unit;
    texture.Bind(unit);
    set_unit(name);
  };
  bind(resources_.face_corners, "face_corners");
  bind(resources_.face_links, "face_links");
  bind(resources_.tile_index, "tile_index");
  bind(resources_.btfel_words, "btfel_words");
  bind(resources_.codec_values, "codec_values");
  bind(resources_.codec_words, "codec_words");

  const auto location = [&](const char* name) { return gl_.GetUniformLocation(shade_program_, name); };
  const glm::vec3 eye = GlmFromEigen(view_.eye - resources_.triangles.centre);
  const bool is_point = light.kind == Light::Kind::kPoint;
  const glm::vec3 place = GlmFromEigen(is_point ? Eigen::Vector3d(light.place - resources_.triangles.centre)
                                                : light.place.normalized());
  const glm::vec3 irradiance = GlmFromEigen(light.irradiance / kPi);
  gl_.Uniform1i(location("tile_size"), resources_.tile_set.tile_size);
  if (resources_.mips != nullptr) {
    const auto set_axis = [&](const char* name, const Eigen::Vector3d& axis) {
      const glm::vec3 value = GlmFromEigen(axis);
      gl_.Uniform3fv(location(name), 1, &value[0]);
    };
    set_axis("view_right", view_.right);
    set_axis("view_up", view_.up);
    set_axis("view_back", view_.back);
    gl_.Uniform1f(location("focal_pixels"), static_cast<float>(0.5 * scene_.height / view_.tan_half_fov_y));
    gl_.Uniform1i(location("parts_per_texel"), resources_.mips->parts_per_texel);
    gl_.Uniform1i(location("num_levels"), static_cast<GLint>(resources_.mips->levels.size()));
    gl_.Uniform1iv(location("level_begin"), static_cast<GLsizei>(resources_.level_begin.size()),
                   resources_.level_begin.data());
  }
  gl_.Uniform3fv(location("eye"), 1, &eye[0]);
  gl_.Uniform4f(location("light"), place.x, place.y, place.z, is_point ? 1.0f : 0.0f);
  gl_.Uniform3fv(location("irradiance_by_pi"), 1, &irradiance[0]);
  gl_.DrawArrays(GL_TRIANGLES, 0, 3);
  gl_.Finish();
}

absl::StatusOr<Image> PreviewDrawing::Draw(const RunContext& context) {
  GlState& state = resources_.state;
  // The codec's program first: when the context is full it drops all others.
  TESSERA_ASSIGN_OR_RETURN(
      shade_program_,
      state.Program(FrameVertexShader(),
                    ShadeFragmentShader(resources_.codec_source, scene_.filter, resources_.mips != nullptr)));
  TESSERA_ASSIGN_OR_RETURN(surface_program_, state.Program(SurfaceVertexShader(), SurfaceFragmentShader()));
  TESSERA_ASSIGN_OR_RETURN(empty_program_, state.Program(FrameVertexShader(), EmptySampleFragmentShader()));
  const int band_rows = std::clamp(kBandPixels / scene_.width, 1, scene_.height);
  std::unique_ptr<Targets>& targets = resources_.targets;
  if (targets == nullptr || targets->width != scene_.width || targets->rows != band_rows) {
    targets = nullptr;
    auto allocated = std::make_unique<Targets>(gl_);
    TESSERA_RETURN_IF_ERROR(allocated->Allocate(state, scene_.width, band_rows));
    targets = std::move(allocated);
  }
  Image image(scene_.width, scene_.height, 4);
  // A scene without lights is drawn once in the dark, for its alpha.
  std::vector<Light> lights = scene_.lights;
  if (lights.empty()) {
    lights.push_back({.irradiance = Eigen::Vector3d::Zero()});
  }
  const int strip_rows = std::max(kStripPixels / scene_.width, 1);
  const auto total_rows = static_cast<uint64_t>(scene_.height);
  for (int first = 0; first < scene_.height; first += band_rows) {
    const int rows = std::min(band_rows, scene_.height - first);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    DrawSamples(first, rows);
    for (int strip = 0; strip < rows; strip += strip_rows) {
      for (const Light& light : lights) {
        TESSERA_RETURN_IF_ERROR(context.CheckStop());
        Shade(light, &light == lights.data(), strip, std::min(strip_rows, rows - strip));
      }
      context.Report("render", static_cast<uint64_t>(std::min(first + strip + strip_rows, first + rows)),
                     total_rows, "rows");
    }
    gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
    gl_.ReadPixels(0, 0, scene_.width, rows, GL_RGBA, GL_FLOAT, image.at(0, first));
    TESSERA_RETURN_IF_ERROR(resources_.state.CheckError("drawing"));
  }
  return image;
}

}  // namespace

GlPreview::GlPreview(OffscreenContext& context, std::unique_ptr<Resources> resources)
    : context_(context), resources_(std::move(resources)) {}

GlPreview::~GlPreview() {
  const ScopedCurrent current(context_);
  resources_.reset();
}

absl::StatusOr<std::unique_ptr<GlPreview>> GlPreview::Create(OffscreenContext& context,
                                                             const Dressing& dressing,
                                                             const TileSet& tile_set, const TileMips* mips) {
  if (dressing.mesh.quads.empty()) {
    return absl::InvalidArgumentError("the dressing has no quads");
  }
  TESSERA_ASSIGN_OR_RETURN(const DressedSurface surface, DressedSurface::Create(dressing, tile_set, mips));
  const Codec* codec = FindCodec(tile_set.btfels.codec_id);
  if (codec == nullptr) {
    return absl::UnimplementedError(absl::StrCat("codec ", tile_set.btfels.codec_id, " is not known here"));
  }
  std::vector<const BtfelTable*> levels;
  for (int level = 1; level <= surface.num_mip_levels(); ++level) {
    levels.push_back(&surface.btfels(level));
  }
  TESSERA_ASSIGN_OR_RETURN(const CodecGlsl glsl, codec->Glsl(tile_set.btfels, levels));
  const ScopedCurrent current(context);
  TESSERA_RETURN_IF_ERROR(current.status());
  TESSERA_ASSIGN_OR_RETURN(GlState* const state, context.gl_state());
  auto resources = std::make_unique<Resources>(*state, dressing, tile_set, mips);
  TESSERA_RETURN_IF_ERROR(resources->Fill(surface, glsl));
  return absl::WrapUnique(new GlPreview(context, std::move(resources)));
}

absl::StatusOr<Image> GlPreview::Render(const PreviewScene& scene, const RunContext& run_context) {
  TESSERA_RETURN_IF_ERROR(CheckScene(scene));
  if (scene.dressing != &resources_->dressing || scene.tile_set != &resources_->tile_set ||
      scene.mips != resources_->mips) {
    return absl::InvalidArgumentError("the scene shows another dressing, tile set or mips than the preview");
  }
  const ScopedCurrent current(context_);
  TESSERA_RETURN_IF_ERROR(current.status());
  return PreviewDrawing(*resources_, scene).Draw(run_context);
}

absl::StatusOr<Image> RenderGl(OffscreenContext& context, const PreviewScene& scene,
                               const RunContext& run_context) {
  TESSERA_RETURN_IF_ERROR(CheckScene(scene));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<GlPreview> preview,
                           GlPreview::Create(context, *scene.dressing, *scene.tile_set, scene.mips));
  return preview->Render(scene, run_context);
}

}  // namespace tessera
