#include "server/rpc/previews.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <span>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"
#include "btf/image/tone_map.h"
#include "btf/mips/tile_mips.h"
#include "btf/render/composite.h"
#include "btf/render/preview.h"
#include "btf/render/preview_scene.h"
#include "btf/wang/shapes.h"
#include "btf/wang/tile_set.h"
#include "proto/wire/convert.h"
#include "proto/wire/names.h"
#include "proto/wire/status.h"
#include "server/rpc/dressings.h"
#include "server/rpc/formats.h"
#include "server/rpc/preview_environment.h"

namespace tessera {
namespace {

constexpr std::chrono::milliseconds kContextPoll{20};
constexpr std::chrono::milliseconds kTellInterval{200};
constexpr double kTexelsWithoutMips = 4.0;  // along a pixel's side

absl::Status Refuse(const std::string& message, std::string_view field) {
  return WithReason(absl::InvalidArgumentError(message), "ARGUMENT_INVALID", field);
}

absl::StatusOr<int> SideOf(uint32_t requested, uint32_t usual, std::string_view field) {
  const uint32_t side = requested == 0 ? usual : requested;
  if (side < kMinPreviewSide || side > kMaxPreviewSide) {
    return Refuse(
        absl::StrCat(std::string(field), " ", side, ", expected ", kMinPreviewSide, " to ", kMaxPreviewSide),
        field);
  }
  return static_cast<int>(side);
}

// Nothing where none are wanted, or where they are not to be had and nobody insists. The scene is complete
// but for them.
absl::StatusOr<std::optional<TileMips>> MipsOf(v1::RenderPreviewRequest::Mips wanted,
                                               const PreviewScene& scene, const RunContext& context) {
  if (!v1::RenderPreviewRequest::Mips_IsValid(wanted)) {
    return Refuse(absl::StrCat("mips ", static_cast<int>(wanted), ", expected AUTO, ON or OFF"), "mips");
  }
  const bool is_auto = wanted == v1::RenderPreviewRequest::AUTO;
  if (wanted == v1::RenderPreviewRequest::OFF || (is_auto && TexelsPerPixel(scene) <= kTexelsWithoutMips)) {
    return std::nullopt;
  }
  absl::StatusOr<TileMips> mips = MakeTileMips(*scene.tile_set, {.max_bytes = kMaxPreviewMipBytes}, context);
  if (mips.ok()) {
    return *std::move(mips);
  }
  const bool is_refused = absl::IsInvalidArgument(mips.status()) || absl::IsResourceExhausted(mips.status());
  if (is_auto && is_refused) {
    return std::nullopt;
  }
  return is_refused ? WithReason(mips.status(), "ARGUMENT_INVALID", "mips") : mips.status();
}

absl::Status WithField(const absl::Status& status, std::string_view field) {
  return absl::IsInvalidArgument(status) ? WithReason(status, "ARGUMENT_INVALID", field) : status;
}

// What becomes of the linear picture.
struct Development {
  Tone tone;
  std::optional<Background> background;
};

absl::StatusOr<Development> DevelopmentOf(const v1::RenderPreviewRequest& request) {
  const bool is_exr = request.format() == v1::RenderPreviewRequest::EXR;
  Development development;
  if (request.has_tone()) {
    const absl::StatusOr<Tone> tone = ToneFromMessage(request.tone());
    TESSERA_RETURN_IF_ERROR(WithField(tone.status(), "tone"));
    TESSERA_RETURN_IF_ERROR(WithField(CheckTone(*tone), "tone"));
    if (is_exr && *tone != Tone{}) {
      return Refuse("exposure and tone are for PNG: an EXR stays linear", "tone");
    }
    development.tone = *tone;
  }
  if (!request.background().empty()) {
    const absl::StatusOr<Background> background = ParseBackground(request.background());
    TESSERA_RETURN_IF_ERROR(WithField(background.status(), "background"));
    if (is_exr) {
      return Refuse("a background is for PNG: an EXR keeps its coverage", "background");
    }
    development.background = *background;
  }
  return development;
}

absl::StatusOr<std::string> Encode(Image image, const Development& development) {
  TESSERA_RETURN_IF_ERROR(ApplyTone(development.tone, image));
  if (development.background.has_value()) {
    TESSERA_ASSIGN_OR_RETURN(image, CompositeOver(image, *development.background));
  }
  return EncodePng(image);
}

absl::StatusOr<std::optional<ShadowParams>> ShadowsOf(const v1::RenderPreviewRequest& request) {
  if (!request.shadows()) {
    if (request.shadow_map_size() != 0) {
      return Refuse("a shadow map size without shadows", "shadow_map_size");
    }
    return std::nullopt;
  }
  ShadowParams shadows;
  if (request.shadow_map_size() != 0) {
    const uint32_t size = request.shadow_map_size();
    if (size < kLeastShadowMap || size > kMostShadowMap) {
      return Refuse(
          absl::StrCat("shadow map size ", size, ", expected ", kLeastShadowMap, " to ", kMostShadowMap),
          "shadow_map_size");
    }
    shadows.map_size = static_cast<int>(size);
  }
  return shadows;
}

// The camera, and the lights turned with it.
absl::Status SetCamera(const v1::RenderPreviewRequest& request, PreviewScene& scene) {
  const QuadMesh& mesh = scene.dressing->mesh;
  if (!request.has_orbit()) {
    scene.camera = request.has_camera() ? CameraFromMessage(request.camera())
                                        : FramingCamera(mesh, scene.width, scene.height);
    return absl::OkStatus();
  }
  if (request.has_camera()) {
    return Refuse("camera and orbit: expected at most one", "orbit");
  }
  const Orbit orbit = OrbitFromMessage(request.orbit());
  absl::StatusOr<Camera> camera = OrbitCamera(mesh, orbit, scene.width, scene.height);
  TESSERA_RETURN_IF_ERROR(WithField(camera.status(), "orbit"));
  scene.camera = *std::move(camera);
  if (request.orbit().turns_lights()) {
    for (Light& light : scene.lights) {
      light = LightTurnedAbout(light, scene.camera.target, orbit.azimuth_rad);
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Dressing> PreviewsService::SurfaceOf(const v1::RenderPreviewRequest& request,
                                                    const std::string& arrangement,
                                                    const RunContext& context) const {
  // A picture shows breaks rather than refusing them.
  const DressParams params{.seed = request.seed(), .allow_breaks = true};
  switch (request.surface_case()) {
    case v1::RenderPreviewRequest::kDressingSha256: {
      TESSERA_RETURN_IF_ERROR(CheckDigest(request.dressing_sha256(), "dressing_sha256"));
      TESSERA_ASSIGN_OR_RETURN(const std::string bytes,
                               backend_.blobs.ReadAll(request.dressing_sha256(), kMaxDressingBytes));
      absl::StatusOr<Dressing> dressing = ParseDressing(std::as_bytes(std::span(bytes)));
      if (!dressing.ok()) {
        return FormatInvalid(dressing.status(), request.dressing_sha256());
      }
      return dressing;
    }
    case v1::RenderPreviewRequest::kBuiltin: {
      TESSERA_ASSIGN_OR_RETURN(const QuadMesh mesh, BuiltinShape(request.builtin()));
      TESSERA_ASSIGN_OR_RETURN(DressResult result, DressSurface(mesh, arrangement, params, context));
      return std::move(result.dressing);
    }
    case v1::RenderPreviewRequest::kMeshSha256: {
      TESSERA_ASSIGN_OR_RETURN(const QuadMesh mesh, ReadUploadedMesh(backend_, request.mesh_sha256()));
      TESSERA_ASSIGN_OR_RETURN(DressResult result, DressSurface(mesh, arrangement, params, context));
      return std::move(result.dressing);
    }
    case v1::RenderPreviewRequest::SURFACE_NOT_SET:
      break;
  }
  return Refuse("a surface is needed: dressing_sha256, builtin or mesh_sha256", "surface");
}

absl::StatusOr<std::string> PreviewsService::Render(const v1::RenderPreviewRequest& request,
                                                    const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const TileSetId id, ParseTileSetName(request.tile_set()));
  PreviewScene scene;
  TESSERA_ASSIGN_OR_RETURN(scene.width, SideOf(request.width(), 640, "width"));
  TESSERA_ASSIGN_OR_RETURN(scene.height, SideOf(request.height(), 480, "height"));
  TESSERA_ASSIGN_OR_RETURN(const Development development, DevelopmentOf(request));
  TESSERA_ASSIGN_OR_RETURN(scene.shadows, ShadowsOf(request));
  if (request.lights_size() > kMaxPreviewLights) {
    return Refuse(absl::StrCat(request.lights_size(), " lights, at most ", kMaxPreviewLights), "lights");
  }
  if (request.lights_size() > 0 || request.has_environment()) {
    scene.lights.clear();
    std::transform(request.lights().begin(), request.lights().end(), std::back_inserter(scene.lights),
                   LightFromMessage);
  }
  v1::TileSet entry;
  TESSERA_RETURN_IF_ERROR(backend_.connections.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(entry, tessera::GetTileSet(db, id));
    return absl::OkStatus();
  }));
  TESSERA_ASSIGN_OR_RETURN(const Dressing dressing, SurfaceOf(request, id.arrangement, context));
  if (dressing.arrangement_id != id.arrangement ||
      dressing.arrangement_sha256 != entry.arrangement_sha256()) {
    return WithReason(absl::FailedPreconditionError(absl::StrCat(
                          "the dressing is for ", dressing.arrangement_id, " (", dressing.arrangement_sha256,
                          "), the tile set of ", id.arrangement, " (", entry.arrangement_sha256(), ")")),
                      "ARRANGEMENT_MISMATCH", request.tile_set());
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes,
                           backend_.blobs.ReadAll(entry.blob().sha256(), kMaxContainerBytes));
  TESSERA_ASSIGN_OR_RETURN(const TileSet tile_set, ParseTileSet(std::as_bytes(std::span(bytes))));
  scene.dressing = &dressing;
  scene.tile_set = &tile_set;
  TESSERA_RETURN_IF_ERROR(SetCamera(request, scene));
  TESSERA_ASSIGN_OR_RETURN(const PreviewEnvironment environment, EnvironmentOf(backend_, request));
  scene.lights.insert(scene.lights.end(), environment.lights.begin(), environment.lights.end());
  scene.frequency_light = environment.frequency_light.has_value() ? &*environment.frequency_light : nullptr;
  TESSERA_ASSIGN_OR_RETURN(const std::optional<TileMips> mips, MipsOf(request.mips(), scene, context));
  scene.mips = mips.has_value() ? &*mips : nullptr;

  std::unique_lock lock(context_mutex_, std::defer_lock);
  while (!lock.try_lock_for(kContextPoll)) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  if (context_ == nullptr) {
    TESSERA_ASSIGN_OR_RETURN(context_, CreateOsmesaContext());
  }
  TESSERA_ASSIGN_OR_RETURN(Image image, RenderGl(*context_, scene, context));
  lock.unlock();
  return request.format() == v1::RenderPreviewRequest::EXR ? EncodeExr(image)
                                                           : Encode(std::move(image), development);
}

absl::Status PreviewsService::RenderPreview(const v1::RenderPreviewRequest& request,
                                            const IsCancelled& is_cancelled, const WritePreview& write) {
  std::string picture;
  TESSERA_RETURN_IF_ERROR(RunForCaller(is_cancelled, [&](const RunContext& run_context) -> absl::Status {
    RunContext context = run_context;
    auto told = std::chrono::steady_clock::now();
    context.progress = [&](const Progress& progress) {
      const auto now = std::chrono::steady_clock::now();
      if (now - told < kTellInterval) {
        return;
      }
      told = now;
      v1::RenderPreviewResponse response;
      *response.mutable_progress() = MessageFromProgress(progress);
      (void)write(response);  // a caller that is gone is found by RunForCaller
    };
    TESSERA_ASSIGN_OR_RETURN(picture, Render(request, context));
    return absl::OkStatus();
  }));
  v1::RenderPreviewResponse response;
  for (size_t offset = 0; offset < picture.size(); offset += kChunkBytes) {
    response.set_data(picture.substr(offset, kChunkBytes));
    if (!write(response)) {
      return absl::CancelledError("the caller went away");
    }
  }
  return absl::OkStatus();
}

}  // namespace tessera
