#include "btf/render/harmonics_glsl.h"

#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/light/sh_rotation.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {

std::string HarmonicsAtGlsl(int n) {
  const int degree = ShDegree(n);
  std::string out = absl::StrFormat(R"(
uniform vec3 harmonics[%d];

void TurnAboutZ(inout vec3 c[%d], float cosine, float sine) {
  vec2 p = vec2(1.0, 0.0);
  vec3 v;
)",
                                    n, n);
  for (int m = 1; m <= degree; ++m) {
    absl::StrAppend(&out, "  p = vec2(p.x * cosine - p.y * sine, p.x * sine + p.y * cosine);\n");
    for (int l = m; l <= degree; ++l) {
      absl::StrAppendFormat(
          &out, "  v = c[%1$d]; c[%1$d] = v * p.x - c[%2$d] * p.y; c[%2$d] = v * p.y + c[%2$d] * p.x;\n",
          l * (l + 1) + m, l * (l + 1) - m);
    }
  }
  absl::StrAppend(&out, "}\n");
  Eigen::Matrix3d quarter;  // about x
  quarter << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  const auto append_turn = [&](const char* name, const Eigen::Matrix3d& rotation) {
    const Eigen::MatrixXd matrix = ShRotation(rotation, degree).Matrix();
    absl::StrAppendFormat(&out, "void %s(inout vec3 c[%d]) {\n  vec3 v[%d] = c;\n", name, n, n);
    for (int i = 1; i < n; ++i) {
      absl::StrAppendFormat(&out, "  c[%d] = vec3(0.0)", i);
      for (int j = 0; j < n; ++j) {
        if (std::abs(matrix(i, j)) > 1e-12) {
          absl::StrAppendFormat(&out, " + %.9e * v[%d]", matrix(i, j), j);
        }
      }
      absl::StrAppend(&out, ";\n");
    }
    absl::StrAppend(&out, "}\n");
  };
  append_turn("TurnAboutX", quarter);
  append_turn("TurnBackAboutX", quarter.transpose());
  absl::StrAppend(&out, R"(
Incidence LightAt(vec3 position, vec3 t, vec3 b, vec3 n, out vec3 falloff) {
  falloff = vec3(1.0);
  float sine = length(n.xy);
  vec2 azimuth = sine > 1e-6 ? n.xy / sine : vec2(1.0, 0.0);
  Incidence c = harmonics;
  TurnAboutZ(c, azimuth.x, -azimuth.y);
  TurnAboutX(c);
  TurnAboutZ(c, n.z, -sine);
  TurnBackAboutX(c);
  TurnAboutZ(c, dot(t, vec3(n.z * azimuth, -sine)), -dot(t, vec3(-azimuth.y, azimuth.x, 0.0)));
  return c;
}
)");
  return out;
}

}  // namespace tessera
