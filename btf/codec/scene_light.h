// What lights a scene: what models are chosen and sent for.
#pragma once

#include <optional>
#include <string_view>

namespace tessera {

enum class SceneLight {
  kPoint,        // lamps and the sun: one look-up a lamp
  kEnvironment,  // all of the sky: models that project on spherical harmonics take it as one sum
};

[[nodiscard]] constexpr std::string_view SceneLightName(SceneLight light) {
  return light == SceneLight::kPoint ? "point" : "environment";
}
[[nodiscard]] constexpr std::optional<SceneLight> FindSceneLight(std::string_view name) {
  for (const SceneLight light : {SceneLight::kPoint, SceneLight::kEnvironment}) {
    if (SceneLightName(light) == name) {
      return light;
    }
  }
  return std::nullopt;
}

}  // namespace tessera
