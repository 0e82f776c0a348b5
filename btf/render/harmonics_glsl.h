// Light from all around in the frame of a pixel, as GLSL.
#pragma once

#include <string>

namespace tessera {

// Declares `uniform vec3 harmonics[n]`, the light over pi in harmonics of the world's directions, and
//   Incidence LightAt(vec3 position, vec3 t, vec3 b, vec3 n, out vec3 falloff)
// the same by directions of the frame of these axes, orthonormal and right-handed; falloff is 1. `Incidence`
// is vec3[n] (codec/turns_glsl.h), n a legal count (math/spherical_harmonics.h).
//
// The frame's axis n is turned from the pole in two steps, by the azimuth and, about y, by the polar angle;
// what then is left is a turn about n. About z harmonics turn in pairs, and a turn about y is one about z
// between two by a quarter about x, whose matrices are constants, mostly zeros, by
// light/sh_rotation.h. At the pole any azimuth does, as
// the last turn follows from the other two.
[[nodiscard]] std::string HarmonicsAtGlsl(int n);

}  // namespace tessera
