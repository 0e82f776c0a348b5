#include "btf/codec/turns_glsl.h"

#include <absl/strings/str_cat.h>
#include <absl/strings/substitute.h>

#include "btf/math/spherical_harmonics.h"

namespace tessera {

std::string TurnHarmonicsGlsl(int size) {
  std::string out = absl::Substitute(R"(
void TurnHarmonics(inout vec3 c[$0], int turns) {
  vec2 once = (turns & 1) != 0 ? vec2(0.0, 1.0) : vec2(1.0, 0.0), p = vec2(1.0, 0.0);
  vec3 v;
  once = (turns & 2) != 0 ? -once : once;
)",
                                     size);
  const int degree = ShDegree(size);
  for (int m = 1; m <= degree; ++m) {
    absl::StrAppend(&out, "  p = vec2(p.x * once.x - p.y * once.y, p.x * once.y + p.y * once.x);\n");
    for (int l = m; l <= degree; ++l) {
      absl::StrAppend(
          &out,
          absl::Substitute("  v = c[$0]; c[$0] = v * p.x + c[$1] * p.y; c[$1] = c[$1] * p.x - v * p.y;\n",
                           l * (l + 1) + m, l * (l + 1) - m));
    }
  }
  absl::StrAppend(&out, "}\n");
  return out;
}

std::string HarmonicsIncidenceGlsl(int n) {
  return absl::StrCat(TurnHarmonicsGlsl(n), "#define Incidence vec3[", n, R"(]
Incidence UnturnedIncidence(Incidence light, int turns) {
  TurnHarmonics(light, turns);
  return light;
}
)");
}

}  // namespace tessera
