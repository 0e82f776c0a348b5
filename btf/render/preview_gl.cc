#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

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

// One call of RenderGl: the scene's objects in GL and the draws.
class PreviewDrawing {
 public:
  PreviewDrawing(GlState& state, const PreviewScene& scene)
      : state_(state),
        gl_(state.gl),
        scene_(scene),
        triangles_(TriangulateSurface(scene.dressing->mesh)),
        view_(MakeViewFrame(scene.camera, triangles_)),
        face_corners_(gl_),
        face_links_(gl_),
        tile_index_(gl_),
        btfel_words_(gl_),
        codec_values_(gl_),
        codec_words_(gl_),
        vertices_(gl_),
        indices_(gl_),
        vertex_array_(gl_),
        no_vertices_(gl_),
        samples_(gl_),
        depth_(gl_),
        pixels_(gl_),
        sample_target_(gl_),
        pixel_target_(gl_) {}

  absl::Status Prepare(const DressedSurface& surface, const CodecGlsl& codec);
  absl::StatusOr<Image> Draw(const RunContext& context);

 private:
  absl::Status FillSurface(const DressedSurface& surface);
  absl::Status MakeTargets();
  void DrawSamples(int first_row, int rows);
  void Shade(const Light& light, int first_row, int num_rows);

  GlState& state_;
  const GladGLContext& gl_;
  const PreviewScene& scene_;
  const SurfaceTriangles triangles_;
  const ViewFrame view_;
  BufferTexture face_corners_;
  BufferTexture face_links_;
  BufferTexture tile_index_;
  BufferTexture btfel_words_;
  BufferTexture codec_values_;
  BufferTexture codec_words_;
  GlBuffer vertices_;
  GlBuffer indices_;
  GlVertexArray vertex_array_;
  GlVertexArray no_vertices_;
  GlTexture samples_;  // RGBA32UI, a layer a sample
  GlRenderbuffer depth_;
  GlTexture pixels_;
  GlFramebuffer sample_target_;
  GlFramebuffer pixel_target_;
  GLuint surface_program_ = 0;
  GLuint shade_program_ = 0;
  int band_rows_ = 0;
};

absl::Status PreviewDrawing::FillSurface(const DressedSurface& surface) {
  const QuadMesh& mesh = surface.dressing().mesh;
  std::vector<float> corners;
  corners.reserve(mesh.quads.size() * 32);
  for (const Quad& quad : mesh.quads) {
    for (const uint32_t vertex : quad) {
      const Eigen::Vector3d p = mesh.positions[vertex].cast<double>() - triangles_.centre;
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
      face_corners_.Fill(std::span<const float>(corners), GL_RGBA32F, 4, "corners of the mesh"));

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
    links.insert(links.end(), {static_cast<int32_t>(surface.dressing().tile[f]),
                               static_cast<int32_t>(surface.dressing().turns[f]), sides, turns});
  }
  TESSERA_RETURN_IF_ERROR(
      face_links_.Fill(std::span<const int32_t>(links), GL_RGBA32I, 4, "links of the mesh"));
  return tile_index_.Fill(std::span<const uint32_t>(surface.tile_set().tile_index), GL_R32UI, 1,
                          "tiles' texels");
}

absl::Status PreviewDrawing::MakeTargets() {
  band_rows_ = std::clamp(kBandPixels / scene_.width, 1, scene_.height);
  gl_.BindTexture(GL_TEXTURE_2D_ARRAY, samples_.name());
  gl_.TexStorage3D(GL_TEXTURE_2D_ARRAY, 1, GL_RGBA32UI, scene_.width, band_rows_, kSamplesPerPixel);
  gl_.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
  gl_.TexParameteri(GL_TEXTURE_2D_ARRAY, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  gl_.BindRenderbuffer(GL_RENDERBUFFER, depth_.name());
  gl_.RenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT32F, scene_.width, band_rows_);
  gl_.BindTexture(GL_TEXTURE_2D, pixels_.name());
  gl_.TexStorage2D(GL_TEXTURE_2D, 1, GL_RGBA32F, scene_.width, band_rows_);

  gl_.BindFramebuffer(GL_FRAMEBUFFER, pixel_target_.name());
  gl_.FramebufferTexture2D(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_TEXTURE_2D, pixels_.name(), 0);
  if (gl_.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    return absl::InternalError("GL offers no RGBA32F framebuffer");
  }
  gl_.BindFramebuffer(GL_FRAMEBUFFER, sample_target_.name());
  gl_.FramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_.name());
  gl_.FramebufferTextureLayer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, samples_.name(), 0, 0);
  if (gl_.CheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
    return absl::InternalError("GL offers no RGBA32UI framebuffer with depth");
  }
  return state_.CheckError("framebuffers");
}

absl::Status PreviewDrawing::Prepare(const DressedSurface& surface, const CodecGlsl& codec) {
  TESSERA_ASSIGN_OR_RETURN(surface_program_, state_.Program(SurfaceVertexShader(), SurfaceFragmentShader()));
  TESSERA_ASSIGN_OR_RETURN(shade_program_,
                           state_.Program(ShadeVertexShader(), ShadeFragmentShader(codec.source)));
  TESSERA_RETURN_IF_ERROR(FillSurface(surface));
  TESSERA_RETURN_IF_ERROR(
      btfel_words_.Fill(std::span<const uint32_t>(codec.btfel_words), GL_RGBA32UI, 4, "BTFels"));
  TESSERA_RETURN_IF_ERROR(
      codec_values_.Fill(std::span<const float>(codec.shared_values), GL_RGBA32F, 4, "codec's tables"));
  if (!codec.shared_words.empty()) {
    TESSERA_RETURN_IF_ERROR(codec_words_.Fill(std::span<const uint32_t>(codec.shared_words), GL_RGBA32UI, 4,
                                              "codec's packed tables"));
  }

  gl_.BindVertexArray(vertex_array_.name());
  gl_.BindBuffer(GL_ARRAY_BUFFER, vertices_.name());
  gl_.BufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(triangles_.vertices.size() * sizeof(SurfaceVertex)),
                 triangles_.vertices.data(), GL_STATIC_DRAW);
  gl_.BindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices_.name());
  gl_.BufferData(GL_ELEMENT_ARRAY_BUFFER,
                 static_cast<GLsizeiptr>(triangles_.indices.size() * sizeof(uint32_t)),
                 triangles_.indices.data(), GL_STATIC_DRAW);
  const auto offset = [](size_t bytes) { return reinterpret_cast<const void*>(bytes); };
  constexpr GLsizei kStride = sizeof(SurfaceVertex);
  gl_.VertexAttribPointer(0, 3, GL_FLOAT, GL_FALSE, kStride, offset(offsetof(SurfaceVertex, position)));
  gl_.VertexAttribPointer(1, 2, GL_FLOAT, GL_FALSE, kStride, offset(offsetof(SurfaceVertex, st)));
  gl_.VertexAttribIPointer(2, 1, GL_UNSIGNED_INT, kStride, offset(offsetof(SurfaceVertex, face)));
  for (GLuint i = 0; i < 3; ++i) {
    gl_.EnableVertexAttribArray(i);
  }
  TESSERA_RETURN_IF_ERROR(state_.CheckError("buffers"));
  return MakeTargets();
}

void PreviewDrawing::DrawSamples(int first_row, int rows) {
  gl_.BindFramebuffer(GL_FRAMEBUFFER, sample_target_.name());
  // Row 0 of the framebuffer is the picture's top row: y is turned over, and so is the winding.
  gl_.Viewport(0, -first_row, scene_.width, scene_.height);
  gl_.Disable(GL_SCISSOR_TEST);
  gl_.Disable(GL_BLEND);
  gl_.Disable(GL_CULL_FACE);
  gl_.Enable(GL_DEPTH_TEST);
  gl_.DepthFunc(GL_LESS);
  gl_.DepthMask(GL_TRUE);
  gl_.FrontFace(GL_CW);
  gl_.UseProgram(surface_program_);

  const Eigen::Vector3d eye = view_.eye - triangles_.centre;
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
  gl_.UniformMatrix4fv(gl_.GetUniformLocation(surface_program_, "clip_from_surface"), 1, GL_FALSE,
                       &clip_from_surface[0][0]);
  const GLint shift = gl_.GetUniformLocation(surface_program_, "sample_shift");
  gl_.BindVertexArray(vertex_array_.name());
  for (int sample = 0; sample < kSamplesPerPixel; ++sample) {
    gl_.FramebufferTextureLayer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, samples_.name(), 0, sample);
    const std::array<GLuint, 4> nothing = {0, 0, 0, 0};
    const GLfloat farthest = 1.0f;
    gl_.ClearBufferuiv(GL_COLOR, 0, nothing.data());
    gl_.ClearBufferfv(GL_DEPTH, 0, &farthest);
    // The pixel centre takes the sample's place when the surface moves the other way.
    gl_.Uniform2f(shift, static_cast<float>(-2.0 * kSampleOffsets[sample][0] / scene_.width),
                  static_cast<float>(-2.0 * kSampleOffsets[sample][1] / scene_.height));
    gl_.DrawElements(GL_TRIANGLES, static_cast<GLsizei>(triangles_.indices.size()), GL_UNSIGNED_INT, nullptr);
  }
  gl_.BindFramebuffer(GL_FRAMEBUFFER, pixel_target_.name());
  gl_.Viewport(0, 0, scene_.width, rows);
  const std::array<GLfloat, 4> black = {0.0f, 0.0f, 0.0f, 0.0f};
  gl_.ClearBufferfv(GL_COLOR, 0, black.data());
}

void PreviewDrawing::Shade(const Light& light, int first_row, int num_rows) {
  gl_.Disable(GL_DEPTH_TEST);
  gl_.Enable(GL_SCISSOR_TEST);
  gl_.Scissor(0, first_row, scene_.width, num_rows);
  // Lights add up; alpha is the same from each.
  gl_.Enable(GL_BLEND);
  gl_.BlendFuncSeparate(GL_ONE, GL_ONE, GL_ONE, GL_ZERO);
  gl_.UseProgram(shade_program_);
  gl_.BindVertexArray(no_vertices_.name());
  gl_.ActiveTexture(GL_TEXTURE0);
  gl_.BindTexture(GL_TEXTURE_2D_ARRAY, samples_.name());
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
  bind(face_corners_, "face_corners");
  bind(face_links_, "face_links");
  bind(tile_index_, "tile_index");
  bind(btfel_words_, "btfel_words");
  bind(codec_values_, "codec_values");
  bind(codec_words_, "codec_words");

  const auto location = [&](const char* name) { return gl_.GetUniformLocation(shade_program_, name); };
  const glm::vec3 eye = GlmFromEigen(view_.eye - triangles_.centre);
  const bool is_point = light.kind == Light::Kind::kPoint;
  const glm::vec3 place =
      GlmFromEigen(is_point ? Eigen::Vector3d(light.place - triangles_.centre) : light.place.normalized());
  const glm::vec3 irradiance = GlmFromEigen(light.irradiance / kPi);
  gl_.Uniform1i(location("tile_size"), scene_.tile_set->tile_size);
  gl_.Uniform1i(location("nearest"), scene_.filter == Filter::kNearest ? 1 : 0);
  gl_.Uniform3fv(location("eye"), 1, &eye[0]);
  gl_.Uniform4f(location("light"), place.x, place.y, place.z, is_point ? 1.0f : 0.0f);
  gl_.Uniform3fv(location("irradiance_by_pi"), 1, &irradiance[0]);
  gl_.DrawArrays(GL_TRIANGLES, 0, 3);
  gl_.Finish();
}

absl::StatusOr<Image> PreviewDrawing::Draw(const RunContext& context) {
  Image image(scene_.width, scene_.height, 4);
  // A scene without lights is drawn once in the dark, for its alpha.
  std::vector<Light> lights = scene_.lights;
  if (lights.empty()) {
    lights.push_back({.irradiance = Eigen::Vector3d::Zero()});
  }
  const int strip_rows = std::max(kStripPixels / scene_.width, 1);
  const auto total_rows = static_cast<uint64_t>(scene_.height);
  for (int first = 0; first < scene_.height; first += band_rows_) {
    const int rows = std::min(band_rows_, scene_.height - first);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    DrawSamples(first, rows);
    for (int strip = 0; strip < rows; strip += strip_rows) {
      for (const Light& light : lights) {
        TESSERA_RETURN_IF_ERROR(context.CheckStop());
        Shade(light, strip, std::min(strip_rows, rows - strip));
      }
      context.Report("render", static_cast<uint64_t>(std::min(first + strip + strip_rows, first + rows)),
                     total_rows, "rows");
    }
    gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
    gl_.ReadPixels(0, 0, scene_.width, rows, GL_RGBA, GL_FLOAT, image.at(0, first));
    TESSERA_RETURN_IF_ERROR(state_.CheckError("drawing"));
  }
  return image;
}

}  // namespace

absl::StatusOr<Image> RenderGl(OffscreenContext& context, const PreviewScene& scene,
                               const RunContext& run_context) {
  TESSERA_RETURN_IF_ERROR(CheckScene(scene));
  TESSERA_ASSIGN_OR_RETURN(const DressedSurface surface,
                           DressedSurface::Create(*scene.dressing, *scene.tile_set));
  const BtfelTable& btfels = scene.tile_set->btfels;
  const Codec* codec = FindCodec(btfels.codec_id);
  if (codec == nullptr) {
    return absl::UnimplementedError(absl::StrCat("codec ", btfels.codec_id, " is not known here"));
  }
  TESSERA_ASSIGN_OR_RETURN(const CodecGlsl glsl, codec->Glsl(btfels));
  const ScopedCurrent current(context);
  TESSERA_RETURN_IF_ERROR(current.status());
  TESSERA_ASSIGN_OR_RETURN(GlState* const state, context.gl_state());
  PreviewDrawing drawing(*state, scene);
  TESSERA_RETURN_IF_ERROR(drawing.Prepare(surface, glsl));
  return drawing.Draw(run_context);
}

}  // namespace tessera
