#include "btf/render/preview_drawing.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <glm/ext/matrix_clip_space.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "btf/base/status_macros.h"
#include "btf/light/frequency_light.h"
#include "btf/render/preview_shaders.h"

namespace tessera {
namespace {

// Pixels whose samples are held at once (64 bytes each), and pixels shaded between two looks at the stop
// token: about a third of a second on two cores.
constexpr int kBandPixels = 1 << 20;
constexpr int kStripPixels = 1 << 18;

glm::vec3 GlmFromEigen(const Eigen::Vector3d& v) {
  return glm::vec3(v.x(), v.y(), v.z());
}

}  // namespace

void PreviewDrawing::DrawSamples(const Band& band) {
  gl_.BindFramebuffer(GL_FRAMEBUFFER, resources_.targets->sample_target.name());
  // Row 0 of the framebuffer is the picture's top row: y is turned over, and so is the winding.
  gl_.Viewport(0, -band.first, scene_.width, scene_.height);
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
}

std::span<const Light> PreviewDrawing::NextBatch(size_t first) {
  const std::span<const Light> rest = std::span<const Light>(lights_).subspan(first);
  if (!scene_.shadows.has_value()) {
    return rest;
  }
  // Where one batch holds all lights, its maps serve every band.
  if (maps_.size() != lights_.size()) {
    maps_ = resources_.shadow_maps->Draw(rest, resources_.triangles, resources_.vertex_array.name(),
                                         shadow_program_);
    batch_begin_ = first;
  }
  return rest.first(maps_.size());
}

void PreviewDrawing::SetLight(size_t light) {
  const auto location = [&](const char* name) { return gl_.GetUniformLocation(shade_program_, name); };
  const Light& source = lights_[light];
  const bool is_point = source.kind == Light::Kind::kPoint;
  const glm::vec3 place = GlmFromEigen(is_point ? Eigen::Vector3d(source.place - resources_.triangles.centre)
                                                : source.place.normalized());
  const glm::vec3 irradiance = GlmFromEigen(source.irradiance / kPi);
  gl_.Uniform4f(location("light"), place.x, place.y, place.z, is_point ? 1.0f : 0.0f);
  gl_.Uniform3fv(location("irradiance_by_pi"), 1, &irradiance[0]);
}

void PreviewDrawing::SetShadows(const LightMaps& maps, int unit) {
  const auto location = [&](const char* name) { return gl_.GetUniformLocation(shade_program_, name); };
  resources_.shadow_maps->Bind(unit);
  gl_.Uniform1i(location("shadow_maps"), unit);
  gl_.Uniform1i(location("shadow_first_layer"), maps.first_layer);
  gl_.Uniform1i(location("shadow_has_cube"), maps.views.size() > 1 ? 1 : 0);
  gl_.Uniform1f(location("shadow_texel_width"), static_cast<float>(maps.views[0].texel_width));
  gl_.Uniform1i(location("cells"), resources_.triangles.cells);
  std::vector<float> matrices;
  for (const ShadowView& view : maps.views) {
    const Eigen::Matrix4f clip_from_surface = view.clip_from_surface.cast<float>();
    matrices.insert(matrices.end(), clip_from_surface.data(), clip_from_surface.data() + 16);
  }
  gl_.UniformMatrix4fv(location("shadow_clip"), static_cast<GLsizei>(maps.views.size()), GL_FALSE,
                       matrices.data());
}

int PreviewDrawing::BeginPass(GLuint program, bool is_first, int first_row, int num_rows) {
  gl_.BindFramebuffer(GL_FRAMEBUFFER, resources_.targets->pixel_target.name());
  gl_.Viewport(0, 0, scene_.width, resources_.targets->rows);
  gl_.Disable(GL_DEPTH_TEST);
  gl_.Enable(GL_SCISSOR_TEST);
  gl_.Scissor(0, first_row, scene_.width, num_rows);
  // Passes add up; alpha is the same from each.
  if (is_first) {
    gl_.Disable(GL_BLEND);
  } else {
    gl_.Enable(GL_BLEND);
  }
  gl_.BlendFuncSeparate(GL_ONE, GL_ONE, GL_ONE, GL_ZERO);
  gl_.UseProgram(program);
  gl_.BindVertexArray(resources_.no_vertices.name());
  gl_.ActiveTexture(GL_TEXTURE0);
  gl_.BindTexture(GL_TEXTURE_2D_ARRAY, resources_.targets->samples.name());
  int units = 0;
  const auto location = [&](const char* name) { return gl_.GetUniformLocation(program, name); };
  gl_.Uniform1i(location("surface_samples"), units++);
  const auto bind = [&](const BufferTexture& texture, const char* name) {
    texture.Bind(units);
    gl_.Uniform1i(location(name), units++);
  };
  bind(resources_.face_corners, "face_corners");
  bind(resources_.face_links, "face_links");
  bind(resources_.tile_index, "tile_index");
  bind(resources_.btfel_words, "btfel_words");
  bind(resources_.codec_values, "codec_values");
  bind(resources_.codec_words, "codec_words");
  bind(resources_.harmonics_values, "harmonics_values");
  bind(resources_.harmonics_words, "harmonics_words");

  const glm::vec3 eye = GlmFromEigen(view_.eye - resources_.triangles.centre);
  gl_.Uniform1i(location("tile_size"), resources_.tile_set.tile_size);
  if (resources_.mips != nullptr) {
    SetMips(program);
  }
  gl_.Uniform3fv(location("eye"), 1, &eye[0]);
  return units;
}

void PreviewDrawing::Shade(size_t light, int first_row, int num_rows) {
  const int units = BeginPass(shade_program_, light == 0, first_row, num_rows);
  if (scene_.shadows.has_value()) {
    SetShadows(maps_[light - batch_begin_], units);
  }
  SetLight(light);
  gl_.DrawArrays(GL_TRIANGLES, 0, 3);
  gl_.Finish();
}

void PreviewDrawing::ShadeAllAround(int first_row, int num_rows) {
  BeginPass(harmonics_program_, lights_.empty(), first_row, num_rows);
  const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor> rows =
      (scene_.frequency_light->coefficients() / kPi).cast<float>();
  gl_.Uniform3fv(gl_.GetUniformLocation(harmonics_program_, "harmonics"), static_cast<GLsizei>(rows.rows()),
                 rows.data());
  gl_.DrawArrays(GL_TRIANGLES, 0, 3);
  gl_.Finish();
}

void PreviewDrawing::SetMips(GLuint program) {
  const auto location = [&](const char* name) { return gl_.GetUniformLocation(program, name); };
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

absl::Status PreviewDrawing::ShadeBand(const Band& band, const RunContext& context) {
  const int strip_rows = std::max(kStripPixels / scene_.width, 1);
  const auto total_rows = static_cast<uint64_t>(scene_.height);
  const size_t num_passes = lights_.size() + (scene_.frequency_light != nullptr ? 1 : 0);
  uint64_t shaded_rows = 0;  // over all passes
  for (size_t begin = 0; begin < lights_.size();) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const size_t num_lights = NextBatch(begin).size();
    for (int strip = 0; strip < band.rows; strip += strip_rows) {
      const int rows = std::min(strip_rows, band.rows - strip);
      for (size_t light = begin; light < begin + num_lights; ++light) {
        TESSERA_RETURN_IF_ERROR(context.CheckStop());
        Shade(light, strip, rows);
        shaded_rows += rows;
      }
      context.Report("render", band.first + shaded_rows / num_passes, total_rows, "rows");
    }
    begin += num_lights;
  }
  for (int strip = 0; scene_.frequency_light != nullptr && strip < band.rows; strip += strip_rows) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const int rows = std::min(strip_rows, band.rows - strip);
    ShadeAllAround(strip, rows);
    shaded_rows += rows;
    context.Report("render", band.first + shaded_rows / num_passes, total_rows, "rows");
  }
  return absl::OkStatus();
}

absl::Status PreviewDrawing::PrepareTargets(int band_rows) {
  std::unique_ptr<PreviewTargets>& targets = resources_.targets;
  if (targets == nullptr || targets->width != scene_.width || targets->rows != band_rows) {
    targets = nullptr;
    auto allocated = std::make_unique<PreviewTargets>(gl_);
    TESSERA_RETURN_IF_ERROR(allocated->Allocate(resources_.state, scene_.width, band_rows));
    targets = std::move(allocated);
  }
  if (!scene_.shadows.has_value()) {
    return absl::OkStatus();
  }
  std::unique_ptr<ShadowMaps>& maps = resources_.shadow_maps;
  const int map_size = scene_.shadows->map_size;
  const int num_layers = ShadowMaps::LayersFor(lights_, resources_.triangles, map_size);
  if (maps == nullptr || maps->map_size() != map_size || maps->num_layers() < num_layers) {
    maps = nullptr;
    auto allocated = std::make_unique<ShadowMaps>(resources_.state, map_size, num_layers);
    TESSERA_RETURN_IF_ERROR(allocated->Allocate());
    maps = std::move(allocated);
  }
  return absl::OkStatus();
}

absl::Status PreviewDrawing::PreparePrograms() {
  GlState& state = resources_.state;
  const ShadeVariant variant{.filter = scene_.filter,
                             .has_mips = resources_.mips != nullptr,
                             .has_shadows = scene_.shadows.has_value()};
  constexpr size_t kMostPrograms = 5;
  state.MakeRoom(kMostPrograms);
  if (!lights_.empty()) {
    TESSERA_ASSIGN_OR_RETURN(
        shade_program_,
        state.Program(FrameVertexShader(), ShadeFragmentShader(resources_.codec_source, variant)));
  }
  if (scene_.frequency_light != nullptr) {
    const int n = scene_.frequency_light->num_functions();
    TESSERA_RETURN_IF_ERROR(resources_.FillHarmonics(n));
    TESSERA_ASSIGN_OR_RETURN(
        harmonics_program_,
        state.Program(FrameVertexShader(),
                      ShadeFragmentShader(
                          resources_.harmonics_source,
                          {.filter = variant.filter, .has_mips = variant.has_mips, .num_harmonics = n})));
  }
  TESSERA_ASSIGN_OR_RETURN(surface_program_, state.Program(SurfaceVertexShader(), SurfaceFragmentShader()));
  TESSERA_ASSIGN_OR_RETURN(empty_program_, state.Program(FrameVertexShader(), EmptySampleFragmentShader()));
  if (variant.has_shadows) {
    TESSERA_ASSIGN_OR_RETURN(shadow_program_, state.Program(ShadowVertexShader(), ShadowFragmentShader()));
  }
  return absl::OkStatus();
}

absl::StatusOr<Image> PreviewDrawing::Draw(const RunContext& context) {
  lights_ = scene_.lights;
  if (lights_.empty() && scene_.frequency_light == nullptr) {
    // Drawn once in the dark, for its alpha.
    lights_.push_back({.irradiance = Eigen::Vector3d::Zero()});
  }
  TESSERA_RETURN_IF_ERROR(PreparePrograms());
  const int band_rows = std::clamp(kBandPixels / scene_.width, 1, scene_.height);
  TESSERA_RETURN_IF_ERROR(PrepareTargets(band_rows));
  Image image(scene_.width, scene_.height, 4);
  for (int first = 0; first < scene_.height; first += band_rows) {
    const Band band{.first = first, .rows = std::min(band_rows, scene_.height - first)};
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    DrawSamples(band);
    TESSERA_RETURN_IF_ERROR(ShadeBand(band, context));
    gl_.PixelStorei(GL_PACK_ALIGNMENT, 1);
    gl_.ReadPixels(0, 0, scene_.width, band.rows, GL_RGBA, GL_FLOAT, image.at(0, first));
    TESSERA_RETURN_IF_ERROR(resources_.state.CheckError("drawing"));
  }
  return image;
}

}  // namespace tessera
