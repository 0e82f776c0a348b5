#include "btf/codec/dsh/dsh_glsl_source.h"

#include <array>
#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/codec/turns_glsl.h"
#include "btf/math/conventions.h"

namespace tessera {
namespace {

constexpr std::array<char, 4> kComponent = {'x', 'y', 'z', 'w'};

int OrderOf(int index) {
  const int l = static_cast<int>(std::sqrt(static_cast<double>(index)));
  return index - l * (l + 1);
}

std::string Literal(double value) {
  return absl::StrFormat("%.9e", value);
}

// `void name(vec3 d, out float y[size])`: real spherical harmonics without the Condon-Shortley sign, index
// l(l+1)+m, as a straight line of code. The azimuthal factors c_m + i s_m = (x + iy)^m carry sin^m; the rest,
// q[l], is the recursion of normalised associated Legendre functions over l. With `basis_begin` >= 0 the
// functions of each order are mapped by the triangular block that lies there (CopyBasis); its entries
// largely cancel, hence doubles.
void AppendHarmonics(const std::string& name, int size, int basis_begin, std::string* out) {
  const int orders = static_cast<int>(std::lround(std::sqrt(size)));
  const bool is_mapped = basis_begin >= 0;
  const char* const suffix = is_mapped ? "LF" : "";
  const auto literal = [&](double value) { return absl::StrCat(Literal(value), suffix); };
  absl::StrAppend(out, "void ", name, "(vec3 d, out float y[", size, "]) {\n  float c = 1.0, s = 0.0, t;\n  ",
                  is_mapped ? "double" : "float", " q[", orders, "], z = d.z;\n");
  if (is_mapped) {
    absl::StrAppend(out, "  vec4 b;\n  double p;\n");
  }
  double diagonal = std::sqrt(0.25 / kPi);
  int entry = 0;
  for (int m = 0; m < orders; ++m) {
    if (m > 0) {
      diagonal *= std::sqrt((2.0 * m + 1.0) / (2.0 * m));
      absl::StrAppend(out, "  t = d.x * c - d.y * s; s = d.x * s + d.y * c; c = t;\n");
    }
    for (int l = m; l < orders; ++l) {
      const std::string q = absl::StrCat("q[", l, "]");
      if (l == m) {
        absl::StrAppend(out, "  ", q, " = ", literal(diagonal * (m > 0 ? std::sqrt(2.0) : 1.0)), ";\n");
      } else if (l == m + 1) {
        absl::StrAppend(out, "  ", q, " = ", literal(std::sqrt(2.0 * m + 3.0)), " * z * q[", m, "];\n");
      } else {
        const double ll = static_cast<double>(l) * l;
        const double below = (l - 1.0) * (l - 1.0);
        const double mm = static_cast<double>(m) * m;
        const double a = std::sqrt((4.0 * ll - 1.0) / (ll - mm));
        const double b = std::sqrt((below - mm) / (4.0 * below - 1.0));
        absl::StrAppend(out, "  ", q, " = ", literal(a), " * z * q[", l - 1, "] - ", literal(a * b), " * q[",
                        l - 2, "];\n");
      }
    }
    for (int l = m; l < orders; ++l) {
      std::string value = absl::StrCat("q[", l, "]");
      if (is_mapped) {
        absl::StrAppend(out, "  p = 0.0LF;\n");
        for (int below = m; below <= l; ++below, ++entry) {
          if (entry % 4 == 0) {
            absl::StrAppend(out, "  b = texelFetch(codec_values, ", basis_begin + entry / 4, ");\n");
          }
          absl::StrAppend(out, "  p += double(b.", std::string(1, kComponent[entry % 4]), ") * q[", below,
                          "];\n");
        }
        value = "float(p)";
      }
      absl::StrAppend(out, "  y[", l * (l + 1) + m, "] = ", value, " * c;\n");
      if (m > 0) {
        absl::StrAppend(out, "  y[", l * (l + 1) - m, "] = ", value, " * s;\n");
      }
    }
  }
  absl::StrAppend(out, "}\n");
}

// y <- basis y, the rows at texel `first` of codec_values, `stride` texels each.
void AppendChangeOfBasis(const std::string& y, int size, int first, std::string* out) {
  const int stride = (size + 3) / 4;
  absl::StrAppend(out, "  {\n    float plain[", size, "] = ", y, ";\n    for (int i = 0; i < ", size,
                  "; ++i) {\n      float sum = 0.0;\n");
  for (int j = 0; j < size; ++j) {
    if (j % 4 == 0) {
      absl::StrAppend(out, "      q = texelFetch(codec_values, ", first, " + i * ", stride, " + ", j / 4,
                      ");\n");
    }
    absl::StrAppend(out, "      sum += q.", std::string(1, kComponent[j % 4]), " * plain[", j, "];\n");
  }
  absl::StrAppend(out, "      ", y, "[i] = sum;\n    }\n  }\n");
}

// y_i times the scale of function i.
void AppendScales(const std::string& y, int size, int first, std::string* out) {
  for (int i = 0; i < size; ++i) {
    if (i % 4 == 0) {
      absl::StrAppend(out, "    q = texelFetch(codec_values, ", first + i / 4, ");\n");
    }
    absl::StrAppend(out, "    ", y, "[", i, "] *= q.", std::string(1, kComponent[i % 4]), ";\n");
  }
}

// BTFel by BTFel, each under its own unturned directions. The codes of a row are written out, so that
// llvmpipe keeps what they need in registers; indexed by a loop they cost several times as much. Of a word's
// two codes the lower stands 2^16 times too high and is summed apart, which saves moving it down. `is_lit`,
// `n`, `yl` and `yv` are there; a light function is a number, or with `is_coloured` one for each channel.
void AppendRows(const DshGlslLayout& layout, bool is_coloured, std::string* out) {
  absl::StrAppend(out, "    int at = btfels[n] * ", layout.kv * layout.btfel_row_texels(),
                  ", j = 0, rows = is_lit ? ", layout.kv, " : 1;\n    vec3 value = vec3(0.0);\n    do {\n",
                  "      vec3 low = vec3(0.0), high = vec3(0.0);\n      uvec4 u[", layout.btfel_row_texels(),
                  "];\n");
  for (int texel = 0; texel < layout.btfel_row_texels(); ++texel) {
    absl::StrAppend(out, "      u[", texel, "] = texelFetch(btfel_words, at + ", texel, ");\n");
  }
  for (int n = 0; n < layout.row_codes(); ++n) {
    const std::string word = absl::StrCat("u[", n / kDshCodesPerTexel, "].",
                                          std::string(1, kComponent[n % kDshCodesPerTexel / 2]));
    const std::string channel(1, kComponent[n / layout.kl]);
    absl::StrAppend(out,
                    n % 2 == 0 ? absl::StrCat("      low.", channel, " += float(int(", word, " << 16))")
                               : absl::StrCat("      high.", channel, " += float(int(", word, ") >> 16)"),
                    " * yl[", n % layout.kl, "]", is_coloured ? absl::StrCat(".", channel) : "", ";\n");
  }
  absl::StrAppend(out, R"(      value += yv[j] * (low * 1.52587890625e-5 + high);
      at += )",
                  layout.btfel_row_texels(), R"(;
    } while (++j < rows);
    sum += weights[n] * value;
  } while (++n < count);
)");
}

void AppendViewFunctions(const DshGlslLayout& layout, std::string* out) {
  absl::StrAppend(out, "    float yv[", layout.kv, "];\n",
                  "    ViewHarmonics(UnturnedDirection(view, turns[n]), yv);\n");
  if (layout.view_form == DshBasisForm::kGeneral) {
    AppendChangeOfBasis("yv", layout.kv, layout.view_basis_begin(), out);
  }
  AppendScales("yv", layout.kv, layout.view_scale_begin(), out);
}

std::string Head(const DshGlslLayout& layout, const std::string& incidence) {
  std::string out = absl::StrCat("uniform usamplerBuffer btfel_words;\nuniform samplerBuffer codec_values;\n",
                                 kUnturnedDirectionGlsl, incidence);
  AppendHarmonics("ViewHarmonics", layout.kv,
                  layout.view_form == DshBasisForm::kByOrder ? layout.view_basis_begin() : -1, &out);
  absl::StrAppend(&out, R"(
vec3 ClampPolar(vec3 d, float cosine, float sine) {
  return d.z < cosine ? vec3(d.xy * (sine / length(d.xy)), cosine) : d;
}
)");
  return out;
}

// `vec3 to[kl]`: the light functions' integrals under the light `from`.
void AppendIntegrals(const Eigen::MatrixXd& integrals, const std::string& from, const std::string& to,
                     std::string* out) {
  const double least = 1e-9 * integrals.cwiseAbs().maxCoeff();
  absl::StrAppend(out, "    vec3 ", to, "[", integrals.rows(), "];\n");
  for (Eigen::Index i = 0; i < integrals.rows(); ++i) {
    absl::StrAppend(out, "    ", to, "[", i, "] = vec3(0.0)");
    for (Eigen::Index k = 0; k < integrals.cols(); ++k) {
      if (std::abs(integrals(i, k)) > least) {
        absl::StrAppend(out, " + ", Literal(integrals(i, k)), " * ", from, "[", k, "]");
      }
    }
    absl::StrAppend(out, ";\n");
  }
}

}  // namespace

DshBasisForm DshBasisFormOf(const CodecTable& basis, int size) {
  const auto partner = [](int index) { return index - 2 * OrderOf(index); };  // of -m
  bool is_identity = true;
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const float value = basis.values[i * size + j];
      is_identity &= value == (i == j ? 1.0f : 0.0f);
      if (OrderOf(i) != OrderOf(j) || j > i ? value != 0.0f
                                            : value != basis.values[partner(i) * size + partner(j)]) {
        return DshBasisForm::kGeneral;
      }
    }
  }
  return is_identity ? DshBasisForm::kPlain : DshBasisForm::kByOrder;
}

std::string DshGlslSource(const DshGlslLayout& layout) {
  std::string out = Head(layout, kDirectionIncidenceGlsl);
  AppendHarmonics("LightHarmonics", layout.kl,
                  layout.light_form == DshBasisForm::kByOrder ? layout.light_basis_begin() : -1, &out);
  absl::StrAppend(&out, R"(
vec3 BlendBtfels(ivec4 btfels, ivec4 turns, vec4 weights, int count, Incidence light, vec3 view) {
  vec4 q = texelFetch(codec_values, 0);
  float scale = light.z < q.x ? light.z / q.x : 1.0;
  bool is_lit = light.z > 0.0 && view.z > 0.0 && count > 0;
  light = ClampPolar(light, q.x, q.y);
  view = ClampPolar(view, q.z, q.w);
  vec3 sum = vec3(0.0);
  int n = 0;
  do {
)");
  absl::StrAppend(&out, "    float yl[", layout.kl, "];\n",
                  "    LightHarmonics(UnturnedDirection(light, turns[n]), yl);\n");
  if (layout.light_form == DshBasisForm::kGeneral) {
    AppendChangeOfBasis("yl", layout.kl, layout.light_basis_begin(), &out);
  }
  AppendScales("yl", layout.kl, DshGlslLayout::kLightScaleBegin, &out);
  AppendViewFunctions(layout, &out);
  AppendRows(layout, /*is_coloured=*/false, &out);
  absl::StrAppend(&out, "  return is_lit ? scale * sum : vec3(0.0);\n}\n");
  return out;
}

std::string DshHarmonicsGlslSource(const DshGlslLayout& layout, const Eigen::MatrixXd& integrals) {
  const auto n = static_cast<int>(integrals.cols());
  const bool turns_as_harmonics = layout.light_form != DshBasisForm::kGeneral;
  std::string out = Head(layout, HarmonicsIncidenceGlsl(n));
  if (turns_as_harmonics && layout.kl != n) {
    absl::StrAppend(&out, TurnHarmonicsGlsl(layout.kl));
  }
  absl::StrAppend(&out, R"(
vec3 BlendBtfels(ivec4 btfels, ivec4 turns, vec4 weights, int count, Incidence light, vec3 view) {
  vec4 q = texelFetch(codec_values, 0);
  bool is_lit = view.z > 0.0 && count > 0;
  view = ClampPolar(view, q.z, q.w);
  vec3 sum = vec3(0.0);
  int n = 0;
)");
  // Once for all turns where the functions allow it.
  if (turns_as_harmonics) {
    AppendIntegrals(integrals, "light", "unturned", &out);
    absl::StrAppend(&out, "  do {\n    vec3 yl[", layout.kl,
                    "] = unturned;\n    TurnHarmonics(yl, turns[n]);\n");
  } else {
    absl::StrAppend(&out, "  do {\n    Incidence turned = UnturnedIncidence(light, turns[n]);\n");
    AppendIntegrals(integrals, "turned", "yl", &out);
  }
  AppendScales("yl", layout.kl, DshGlslLayout::kLightScaleBegin, &out);
  AppendViewFunctions(layout, &out);
  AppendRows(layout, /*is_coloured=*/true, &out);
  absl::StrAppend(&out, "  return is_lit ? sum : vec3(0.0);\n}\n");
  return out;
}

}  // namespace tessera
