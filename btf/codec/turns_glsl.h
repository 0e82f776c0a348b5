// Light, and quarter turns of BTFels, in GLSL, for the decoders of every codec.
#pragma once

#include <string>

namespace tessera {

// `vec3 UnturnedDirection(vec3 d, int turns)`: the direction in the frame of a BTFel turned `turns` times, as
// UnturnedFromTurned.
inline constexpr char kUnturnedDirectionGlsl[] = R"(
vec3 UnturnedDirection(vec3 d, int turns) {
  vec2 odd = (turns & 1) != 0 ? vec2(d.y, -d.x) : d.xy;
  return vec3((turns & 2) != 0 ? -odd : odd, d.z);
}
)";

// `Incidence`, how light comes in, and `Incidence UnturnedIncidence(Incidence light, int turns)`, the light
// in that frame. From one direction, the type is `vec3`, or from all around as `n` spherical harmonics (a
// legal count), `vec3[n]`. Stands behind kUnturnedDirectionGlsl.
inline constexpr char kDirectionIncidenceGlsl[] = R"(
#define Incidence vec3
Incidence UnturnedIncidence(Incidence light, int turns) {
  return UnturnedDirection(light, turns);
}
)";
[[nodiscard]] std::string HarmonicsIncidenceGlsl(int n);

// `void TurnHarmonics(inout vec3 c[size], int turns)`: coefficients of `size` functions that turn as
// spherical harmonics do, in the frame of a BTFel turned `turns` times. One function a size.
[[nodiscard]] std::string TurnHarmonicsGlsl(int size);

// BlendBtfels of codec.h by
//   vec3 BlendUnturned(ivec4 btfels, vec4 weights, int count, Incidence light, vec3 view)
// for BTFels of no turn, called once for each turn that a pixel's BTFels have: for codecs to whom the
// directions cost more than the BTFels. Weights beyond `count`, which may be 0, are 0. Loops are tested at
// their end: on llvmpipe one that is tested at its start runs once more for nothing.
inline constexpr char kBlendByTurnGlsl[] = R"(
vec3 BlendBtfels(ivec4 btfels, ivec4 turns, vec4 weights, int count, Incidence light, vec3 view) {
  vec3 sum = vec3(0.0);
  ivec4 pending = ivec4(lessThan(ivec4(0, 1, 2, 3), ivec4(count)));
  do {
    int turn = pending.x > 0 ? turns.x : pending.y > 0 ? turns.y : pending.z > 0 ? turns.z : turns.w;
    ivec4 group = ivec4(0);
    vec4 group_weights = vec4(0.0);
    int group_count = 0;
    for (int n = 0; n < 4; ++n) {
      if (pending[n] > 0 && turns[n] == turn) {
        group[group_count] = btfels[n];
        group_weights[group_count] = weights[n];
        pending[n] = 0;
        ++group_count;
      }
    }
    sum += BlendUnturned(group, group_weights, group_count, UnturnedIncidence(light, turn),
                         UnturnedDirection(view, turn));
  } while (pending.x + pending.y + pending.z + pending.w > 0);
  return sum;
}
)";

}  // namespace tessera
