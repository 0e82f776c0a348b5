#include "client/cli/preview_request.h"

#include <filesystem>

#include "btf/base/status_macros.h"
#include "client/cli/exit_codes.h"

namespace tessera::cli {
namespace {

constexpr double kTurntableElevationDeg = 25.0;

bool HasCamera(const PreviewFlags& flags) {
  return !flags.eye.empty() || !flags.target.empty() || !flags.up.empty();
}

absl::StatusOr<v1::Camera> CameraOf(const PreviewFlags& flags) {
  v1::Camera camera;
  TESSERA_ASSIGN_OR_RETURN(const auto eye, ParsePlace("eye", flags.eye));
  camera.set_eye_x(eye[0]);
  camera.set_eye_y(eye[1]);
  camera.set_eye_z(eye[2]);
  if (!flags.target.empty()) {
    TESSERA_ASSIGN_OR_RETURN(const auto target, ParsePlace("target", flags.target));
    camera.set_target_x(target[0]);
    camera.set_target_y(target[1]);
    camera.set_target_z(target[2]);
  }
  if (!flags.up.empty()) {
    TESSERA_ASSIGN_OR_RETURN(const auto up, ParsePlace("up", flags.up));
    camera.set_up_x(up[0]);
    camera.set_up_y(up[1]);
    camera.set_up_z(up[2]);
  }
  camera.set_fov_y_deg(flags.fov_deg);
  return camera;
}

absl::Status SetView(const PreviewFlags& flags, v1::RenderPreviewRequest& request) {
  if (HasCamera(flags)) {
    TESSERA_ASSIGN_OR_RETURN(*request.mutable_camera(), CameraOf(flags));
  } else if (!flags.orbit.empty()) {
    TESSERA_ASSIGN_OR_RETURN(*request.mutable_orbit(), ParseOrbit(flags.orbit));
  } else if (flags.turntable > 0) {
    request.mutable_orbit()->set_elevation_deg(kTurntableElevationDeg);
  }
  if (request.has_orbit()) {
    request.mutable_orbit()->set_fov_y_deg(flags.fov_deg);
  }
  return absl::OkStatus();
}

void SetEnvironment(const PreviewFlags& flags, v1::RenderPreviewRequest& request) {
  if (flags.environment.empty()) {
    return;
  }
  v1::EnvironmentLight& environment = *request.mutable_environment();
  environment.set_rotation_deg(flags.environment_rotation_deg);
  environment.set_scale(flags.environment_scale);
  if (flags.environment_lights != 0) {
    environment.set_num_lights(flags.environment_lights);
  } else if (flags.environment_order != 0) {
    environment.set_order(flags.environment_order);
  }
}

void SetDevelopment(const PreviewFlags& flags, v1::RenderPreviewRequest& request) {
  if (flags.exposure_stops != 0.0 || flags.tone != "none" || flags.white != 0.0) {
    v1::Tone& tone = *request.mutable_tone();
    tone.set_exposure_stops(flags.exposure_stops);
    tone.set_curve(flags.tone == "reinhard" ? v1::Tone::REINHARD
                   : flags.tone == "filmic" ? v1::Tone::FILMIC
                                            : v1::Tone::NONE);
    tone.set_white(flags.white);
  }
  if (flags.background != "transparent") {
    request.set_background(flags.background);
  }
}

}  // namespace

absl::Status CheckPreviewFlags(const PreviewFlags& flags) {
  if (flags.dressings.empty() && flags.meshes.empty()) {
    return UsageError("preview takes a --dressing or a --mesh");
  }
  if (HasCamera(flags) && flags.eye.empty()) {
    return UsageError("--target and --up go with --eye");
  }
  if (HasCamera(flags) && (!flags.orbit.empty() || flags.turntable > 0)) {
    return UsageError("--eye excludes --orbit and --turntable");
  }
  if (flags.fov_deg != 0.0 && !HasCamera(flags) && flags.orbit.empty() && flags.turntable == 0) {
    return UsageError("--fov goes with --eye, --orbit or --turntable");
  }
  if (flags.shadow_map != 0 && !flags.shadows) {
    return UsageError("--shadow-map goes with --shadows");
  }
  const bool has_environment = !flags.environment.empty();
  if (!has_environment && (flags.environment_lights != 0 || flags.environment_order != 0 ||
                           flags.environment_rotation_deg != 0.0 || flags.environment_scale != 0.0)) {
    return UsageError("--env-lights, --env-order, --env-rotation and --env-scale go with --env");
  }
  if (flags.environment_lights != 0 && flags.environment_order != 0) {
    return UsageError("--env-lights excludes --env-order");
  }
  const size_t num_pictures = flags.tile_sets.size() * (flags.dressings.size() + flags.meshes.size());
  if (flags.turntable > 0 && (flags.sheet || num_pictures > 1)) {
    return UsageError("--turntable shows one tile set on one mesh");
  }
  if (flags.animated && flags.turntable == 0) {
    return UsageError("--animated goes with --turntable");
  }
  if (flags.columns != 0 && !flags.sheet) {
    return UsageError("--columns goes with --sheet");
  }
  TESSERA_ASSIGN_OR_RETURN(const PictureFormat format, PreviewFormat(flags));
  if (format == PictureFormat::kExr && (flags.animated || flags.sheet)) {
    return UsageError("sheets and animations are PNG");
  }
  return absl::OkStatus();
}

absl::StatusOr<PictureFormat> PreviewFormat(const PreviewFlags& flags) {
  if (flags.animated && std::filesystem::path(flags.output).extension() == ".apng") {
    return PictureFormat::kPng;
  }
  return PictureFormatOf(flags.output);
}

absl::StatusOr<v1::RenderPreviewRequest> PreviewRequest(const PreviewFlags& flags) {
  v1::RenderPreviewRequest request;
  TESSERA_ASSIGN_OR_RETURN(const PictureSize size, ParsePictureSize(flags.size));
  request.set_width(size.width);
  request.set_height(size.height);
  for (const std::string& light : flags.lights) {
    TESSERA_ASSIGN_OR_RETURN(*request.add_lights(), ParseLight(light));
  }
  TESSERA_ASSIGN_OR_RETURN(const PictureFormat format, PreviewFormat(flags));
  request.set_format(format == PictureFormat::kPng ? v1::RenderPreviewRequest::PNG
                                                   : v1::RenderPreviewRequest::EXR);
  request.set_seed(flags.seed);
  request.set_mips(flags.mips == "on"    ? v1::RenderPreviewRequest::ON
                   : flags.mips == "off" ? v1::RenderPreviewRequest::OFF
                                         : v1::RenderPreviewRequest::AUTO);
  request.set_shadows(flags.shadows);
  request.set_shadow_map_size(flags.shadow_map);
  TESSERA_RETURN_IF_ERROR(SetView(flags, request));
  SetEnvironment(flags, request);
  SetDevelopment(flags, request);
  return request;
}

v1::RenderPreviewRequest TurntableRequest(const v1::RenderPreviewRequest& base, int frame, int frames) {
  v1::RenderPreviewRequest request = base;
  v1::Orbit& orbit = *request.mutable_orbit();
  orbit.set_azimuth_deg(orbit.azimuth_deg() + 360.0 * frame / frames);
  orbit.set_turns_lights(true);
  return request;
}

}  // namespace tessera::cli
