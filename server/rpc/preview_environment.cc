#include "server/rpc/preview_environment.h"

#include <span>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/light/environment.h"
#include "btf/light/q2_tree.h"
#include "btf/math/conventions.h"
#include "proto/wire/status.h"
#include "server/rpc/formats.h"

namespace tessera {
namespace {

constexpr int kUsualEnvironmentLights = 50;
constexpr int kUsualEnvironmentOrder = 5;

absl::Status RefuseEnvironment(const std::string& message) {
  return WithReason(absl::InvalidArgumentError(message), "ARGUMENT_INVALID", "environment");
}

absl::Status CheckMethod(const v1::RenderPreviewRequest& request) {
  const v1::EnvironmentLight& environment = request.environment();
  switch (environment.method_case()) {
    case v1::EnvironmentLight::kNumLights:
      if (environment.num_lights() < 1 || environment.num_lights() > kMaxEnvironmentLights) {
        return RefuseEnvironment(absl::StrCat("an environment as ", environment.num_lights(),
                                              " lights, expected 1 to ", kMaxEnvironmentLights));
      }
      break;
    case v1::EnvironmentLight::kOrder:
      if (environment.order() < 1 || environment.order() > kMaxEnvironmentOrder) {
        return RefuseEnvironment(absl::StrCat("an environment of order ", environment.order(),
                                              ", expected 1 to ", kMaxEnvironmentOrder));
      }
      if (request.shadows() && request.lights().empty()) {
        return RefuseEnvironment(
            "an environment of some order casts no shadows: give a number of lights instead, or lights "
            "beside it");
      }
      break;
    case v1::EnvironmentLight::METHOD_NOT_SET:
      break;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<PreviewEnvironment> EnvironmentOf(const Backend& backend,
                                                 const v1::RenderPreviewRequest& request) {
  if (!request.has_environment()) {
    return PreviewEnvironment{};
  }
  const v1::EnvironmentLight& message = request.environment();
  TESSERA_RETURN_IF_ERROR(CheckMethod(request));
  TESSERA_RETURN_IF_ERROR(CheckDigest(message.sha256(), "environment"));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes,
                           backend.blobs.ReadAll(message.sha256(), kMaxEnvironmentBytes));
  EnvironmentOptions options{.rotation_rad = RadFromDeg(message.rotation_deg())};
  if (request.orbit().turns_lights()) {
    options.rotation_rad += RadFromDeg(request.orbit().azimuth_deg());
  }
  if (message.scale() != 0.0) {
    options.scale = message.scale();
  }
  const absl::StatusOr<Environment> environment =
      DecodeEnvironment(std::as_bytes(std::span(bytes)), "the environment", options);
  if (!environment.ok()) {
    return RefuseEnvironment(std::string(environment.status().message()));
  }
  const bool usually_lights =
      message.method_case() == v1::EnvironmentLight::METHOD_NOT_SET && request.shadows();
  if (message.has_num_lights() || usually_lights) {
    const int count =
        message.has_num_lights() ? static_cast<int>(message.num_lights()) : kUsualEnvironmentLights;
    TESSERA_ASSIGN_OR_RETURN(const std::vector<EnvironmentLight> lights, Q2Tree(*environment).Lights(count));
    return PreviewEnvironment{.lights = DirectionalLights(lights)};
  }
  const int order = message.has_order() ? static_cast<int>(message.order()) : kUsualEnvironmentOrder;
  TESSERA_ASSIGN_OR_RETURN(FrequencyLight light, FrequencyLight::Create(*environment, order * order));
  return PreviewEnvironment{.frequency_light = std::move(light)};
}

}  // namespace tessera
