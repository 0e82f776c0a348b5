#include "btf/codec/dsh/dsh_glsl.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_range.h"
#include "btf/codec/turns_glsl.h"

namespace tessera {
namespace {

constexpr int kMaxBasis = 49;      // l <= 6
constexpr int kCodesPerTexel = 8;  // 16 bits each, of RGBA32UI
constexpr int kMostCode = 32766;   // a rounding below what 16 bits hold
// Coefficients that never exceed this share of the largest one are stored as coarsely as if they did.
constexpr double kLeastShare = 1e-6;
constexpr std::array<char, 4> kComponent = {'x', 'y', 'z', 'w'};

// kl or kv from the shape of a basis table.
absl::StatusOr<int> BasisSize(const BtfelTable& table, const std::string& name) {
  const auto found = table.tables.find(name);
  if (found == table.tables.end()) {
    return absl::InvalidArgumentError(absl::StrCat("codec table ", name, " is missing"));
  }
  const CodecTable& basis = found->second;
  const int64_t size = basis.shape.size() == 2 ? basis.shape[0] : 0;
  const int order = static_cast<int>(std::lround(std::sqrt(static_cast<double>(size))));
  if (size < 1 || size > kMaxBasis || int64_t{order} * order != size || basis.shape[1] != size ||
      static_cast<int64_t>(basis.values.size()) != size * size) {
    return absl::InvalidArgumentError(
        absl::StrCat("codec table ", name, ": expected a square of 1, 4, 9, 16, 25, 36 or 49 rows, got ",
                     size, " rows and ", basis.values.size(), " values"));
  }
  return static_cast<int>(size);
}

int OrderOf(int index) {
  const int l = static_cast<int>(std::sqrt(static_cast<double>(index)));
  return index - l * (l + 1);
}

enum class BasisForm {
  kPlain,    // the identity
  kByOrder,  // each function mixes those of its own order m up to its degree, those of -m alike
  kGeneral,
};

BasisForm FormOf(const CodecTable& basis, int size) {
  const auto partner = [](int index) { return index - 2 * OrderOf(index); };  // of -m
  bool is_identity = true;
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const float value = basis.values[i * size + j];
      is_identity &= value == (i == j ? 1.0f : 0.0f);
      if (OrderOf(i) != OrderOf(j) || j > i ? value != 0.0f
                                            : value != basis.values[partner(i) * size + partner(j)]) {
        return BasisForm::kGeneral;
      }
    }
  }
  return is_identity ? BasisForm::kPlain : BasisForm::kByOrder;
}

absl::StatusOr<double> LargestPolarAngle(const std::vector<Direction>& directions, const char* what) {
  double largest = 0.0;
  for (const Direction& direction : directions) {
    largest = std::max(largest, direction.theta_rad);
  }
  if (directions.empty() || !std::isfinite(largest)) {
    return absl::InvalidArgumentError(absl::StrCat("the table's ", what, " are missing or not finite"));
  }
  return largest;
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

// Where things lie in `codec_values`, in texels of four floats: the cosines and sines of the largest polar
// angles; the scales of the light and of the view functions; then the bases that are not the identity.
struct Layout {
  int kl = 0;
  int kv = 0;
  BasisForm light_form = BasisForm::kPlain;
  BasisForm view_form = BasisForm::kPlain;

  static constexpr int kLightScaleBegin = 1;
  [[nodiscard]] int view_scale_begin() const { return kLightScaleBegin + Texels(kl); }
  [[nodiscard]] int light_basis_begin() const { return view_scale_begin() + Texels(kv); }
  [[nodiscard]] int view_basis_begin() const { return light_basis_begin() + BasisTexels(light_form, kl); }
  [[nodiscard]] int num_texels() const { return view_basis_begin() + BasisTexels(view_form, kv); }
  // A row: the codes of one view function, channel by channel.
  [[nodiscard]] int row_codes() const { return 3 * kl; }
  // Of one row of a BTFel; each starts at a texel.
  [[nodiscard]] int btfel_row_texels() const { return (row_codes() + kCodesPerTexel - 1) / kCodesPerTexel; }
  [[nodiscard]] int btfel_words() const { return kv * btfel_row_texels() * 4; }
  // The place of a coefficient in a BTFel of a table.
  [[nodiscard]] int coefficient(int channel, int j, int i) const { return (channel * kv + j) * kl + i; }

 private:
  static int Texels(int floats) { return (floats + 3) / 4; }
  static int BasisTexels(BasisForm form, int size) {
    switch (form) {
      case BasisForm::kPlain:
        return 0;
      case BasisForm::kByOrder: {
        int entries = 0;
        for (int n = static_cast<int>(std::lround(std::sqrt(size))); n > 0; --n) {
          entries += n * (n + 1) / 2;
        }
        return Texels(entries);
      }
      case BasisForm::kGeneral:
        return size * Texels(size);
    }
    return 0;
  }
};

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
// two codes the lower stands 2^16 times too high and is summed apart, which saves moving it down.
std::string Source(const Layout& layout) {
  std::string out;
  absl::StrAppend(&out, "uniform usamplerBuffer btfel_words;\nuniform samplerBuffer codec_values;\n");
  AppendHarmonics("LightHarmonics", layout.kl,
                  layout.light_form == BasisForm::kByOrder ? layout.light_basis_begin() : -1, &out);
  AppendHarmonics("ViewHarmonics", layout.kv,
                  layout.view_form == BasisForm::kByOrder ? layout.view_basis_begin() : -1, &out);
  absl::StrAppend(&out, kUnturnedDirectionGlsl, R"(
vec3 ClampPolar(vec3 d, float cosine, float sine) {
  return d.z < cosine ? vec3(d.xy * (sine / length(d.xy)), cosine) : d;
}

vec3 BlendBtfels(ivec4 btfels, ivec4 turns, vec4 weights, int count, vec3 light, vec3 view) {
  vec4 q = texelFetch(codec_values, 0);
  float scale = light.z < q.x ? light.z / q.x : 1.0;
  bool is_lit = light.z > 0.0 && view.z > 0.0 && count > 0;
  light = ClampPolar(light, q.x, q.y);
  view = ClampPolar(view, q.z, q.w);
  vec3 sum = vec3(0.0);
  int n = 0;
  do {
)");
  absl::StrAppend(&out, "    float yl[", layout.kl, "], yv[", layout.kv, "];\n",
                  "    LightHarmonics(UnturnedDirection(light, turns[n]), yl);\n",
                  "    ViewHarmonics(UnturnedDirection(view, turns[n]), yv);\n");
  if (layout.light_form == BasisForm::kGeneral) {
    AppendChangeOfBasis("yl", layout.kl, layout.light_basis_begin(), &out);
  }
  if (layout.view_form == BasisForm::kGeneral) {
    AppendChangeOfBasis("yv", layout.kv, layout.view_basis_begin(), &out);
  }
  AppendScales("yl", layout.kl, Layout::kLightScaleBegin, &out);
  AppendScales("yv", layout.kv, layout.view_scale_begin(), &out);
  absl::StrAppend(&out, "    int at = btfels[n] * ", layout.kv * layout.btfel_row_texels(),
                  ", j = 0, rows = is_lit ? ", layout.kv, " : 1;\n    vec3 value = vec3(0.0);\n    do {\n",
                  "      vec3 low = vec3(0.0), high = vec3(0.0);\n      uvec4 u[", layout.btfel_row_texels(),
                  "];\n");
  for (int texel = 0; texel < layout.btfel_row_texels(); ++texel) {
    absl::StrAppend(&out, "      u[", texel, "] = texelFetch(btfel_words, at + ", texel, ");\n");
  }
  for (int n = 0; n < layout.row_codes(); ++n) {
    const std::string word =
        absl::StrCat("u[", n / kCodesPerTexel, "].", std::string(1, kComponent[n % kCodesPerTexel / 2]));
    const std::string channel(1, kComponent[n / layout.kl]);
    absl::StrAppend(&out,
                    n % 2 == 0 ? absl::StrCat("      low.", channel, " += float(int(", word, " << 16))")
                               : absl::StrCat("      high.", channel, " += float(int(", word, ") >> 16)"),
                    " * yl[", n % layout.kl, "];\n");
  }
  absl::StrAppend(&out, R"(      value += yv[j] * (low * 1.52587890625e-5 + high);
      at += )",
                  layout.btfel_row_texels(), R"(;
    } while (++j < rows);
    sum += weights[n] * value;
  } while (++n < count);
  return is_lit ? scale * sum : vec3(0.0);
}
)");
  return out;
}

// Factors a_i and b_j, the products of which are at least `least`[i * kv + j] > 0 and not much above: a_i
// starts as the root of a sum of squares, then each is made as low as the other allows.
void CoverByProducts(const std::vector<double>& least, int kl, int kv, std::span<float> a,
                     std::span<float> b) {
  std::vector<double> over_j(kl, 0.0);
  std::vector<double> over_i(kv, 0.0);
  for (int i = 0; i < kl; ++i) {
    for (int j = 0; j < kv; ++j) {
      over_j[i] += least[i * kv + j] * least[i * kv + j];
    }
    over_j[i] = std::sqrt(over_j[i]);
    for (int j = 0; j < kv; ++j) {
      over_i[j] = std::max(over_i[j], least[i * kv + j] / over_j[i]);
    }
  }
  for (int i = 0; i < kl; ++i) {
    double lowest = 0.0;
    for (int j = 0; j < kv; ++j) {
      lowest = std::max(lowest, least[i * kv + j] / over_i[j]);
    }
    a[i] = static_cast<float>(lowest);
  }
  std::ranges::transform(over_i, b.begin(), [](double factor) { return static_cast<float>(factor); });
}

void CopyBasis(const CodecTable& basis, int size, BasisForm form, int first_texel,
               std::vector<float>* values) {
  float* out = values->data() + 4 * static_cast<ptrdiff_t>(first_texel);
  if (form == BasisForm::kGeneral) {
    for (int i = 0; i < size; ++i, out += (size + 3) / 4 * 4) {
      std::copy_n(basis.values.begin() + static_cast<ptrdiff_t>(i) * size, size, out);
    }
  } else if (form == BasisForm::kByOrder) {
    // Triangles by order m, rows by degree, as AppendHarmonics reads them.
    const int orders = static_cast<int>(std::lround(std::sqrt(size)));
    for (int m = 0; m < orders; ++m) {
      for (int l = m; l < orders; ++l) {
        for (int below = m; below <= l; ++below) {
          *out++ = basis.values[(l * (l + 1) + m) * size + below * (below + 1) + m];
        }
      }
    }
  }
}

// The table's BTFels as multiples of the products of scales; `words` has room for them. Where they end.
uint32_t* PackBtfels(const BtfelTable& table, const Layout& layout, std::span<const float> light_scale,
                     std::span<const float> view_scale, uint32_t* words) {
  const size_t k = table.num_coefficients;
  std::vector<float> step(k);
  std::vector<float> offset(k);  // and what makes the conversion to int round down, then to the nearest
  for (int channel = 0; channel < 3; ++channel) {
    for (int j = 0; j < layout.kv; ++j) {
      for (int i = 0; i < layout.kl; ++i) {
        const int n = layout.coefficient(channel, j, i);
        const double scale = static_cast<double>(light_scale[i]) * view_scale[j];
        step[n] = static_cast<float>(table.step[n] / scale);
        offset[n] = static_cast<float>(table.offset[n] / scale + kMostCode + 0.5);
      }
    }
  }
  // Code n of a row is bits 16 (n % 2) and on of word n / 2: on the little-endian machines that this is for,
  // 16-bit numbers in order.
  static_assert(std::endian::native == std::endian::little);
  const int row_words = layout.btfel_row_texels() * 4;
  auto* row = reinterpret_cast<int16_t*>(words);
  for (size_t btfel = 0; btfel < table.size(); ++btfel) {
    const uint8_t* const codes = table.codes.data() + btfel * k;
    for (int j = 0; j < layout.kv; ++j, row += 2 * static_cast<ptrdiff_t>(row_words)) {
      for (int channel = 0; channel < 3; ++channel) {
        const int first = layout.coefficient(channel, j, 0);
        for (int i = 0; i < layout.kl; ++i) {
          const float code = offset[first + i] + step[first + i] * static_cast<float>(codes[first + i]);
          row[channel * layout.kl + i] = static_cast<int16_t>(static_cast<int>(code) - kMostCode);
        }
      }
    }
  }
  return words + table.size() * layout.btfel_words();
}

}  // namespace

absl::StatusOr<CodecGlsl> DshGlsl(const BtfelTable& table, std::span<const BtfelTable* const> more) {
  Layout layout;
  TESSERA_ASSIGN_OR_RETURN(layout.kl, BasisSize(table, "basis_light"));
  TESSERA_ASSIGN_OR_RETURN(layout.kv, BasisSize(table, "basis_view"));
  TESSERA_ASSIGN_OR_RETURN(const double light_theta, LargestPolarAngle(table.lights, "lights"));
  TESSERA_ASSIGN_OR_RETURN(const double view_theta, LargestPolarAngle(table.views, "views"));
  const size_t k = static_cast<size_t>(3) * layout.kl * layout.kv;
  if (table.num_coefficients != static_cast<int>(k) || table.offset.size() != k || table.step.size() != k ||
      table.codes.size() % k != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("a table of kl = ", layout.kl, ", kv = ", layout.kv, " has ", k, " coefficients, got ",
                     table.num_coefficients, " with ", table.offset.size(), " offsets, ", table.step.size(),
                     " steps and ", table.codes.size(), " codes"));
  }
  TESSERA_RETURN_IF_ERROR(CheckSameCoefficients(table, more));
  const CodecTable& basis_light = table.tables.at("basis_light");
  const CodecTable& basis_view = table.tables.at("basis_view");
  layout.light_form = FormOf(basis_light, layout.kl);
  layout.view_form = FormOf(basis_view, layout.kv);

  CodecGlsl glsl;
  glsl.source = Source(layout);
  glsl.shared_values.resize(static_cast<size_t>(layout.num_texels()) * 4);
  glsl.shared_values[0] = static_cast<float>(std::cos(light_theta));
  glsl.shared_values[1] = static_cast<float>(std::sin(light_theta));
  glsl.shared_values[2] = static_cast<float>(std::cos(view_theta));
  glsl.shared_values[3] = static_cast<float>(std::sin(view_theta));

  // The scales: no coefficient's value exceeds the largest code times those of its functions.
  const std::vector<double> magnitudes = LargestMagnitudes(table, more);
  std::vector<double> largest(static_cast<size_t>(layout.kl) * layout.kv, 0.0);
  for (int i = 0; i < layout.kl; ++i) {
    for (int j = 0; j < layout.kv; ++j) {
      for (int channel = 0; channel < 3; ++channel) {
        largest[i * layout.kv + j] =
            std::max(largest[i * layout.kv + j], magnitudes[layout.coefficient(channel, j, i)]);
      }
    }
  }
  const double most = *std::ranges::max_element(largest);
  for (double& value : largest) {
    value = most > 0.0 ? std::max(value, kLeastShare * most) / kMostCode : 1.0;
  }
  const std::span<float> values(glsl.shared_values);
  const std::span<float> light_scale = values.subspan(4 * Layout::kLightScaleBegin, layout.kl);
  const std::span<float> view_scale = values.subspan(4 * layout.view_scale_begin(), layout.kv);
  CoverByProducts(largest, layout.kl, layout.kv, light_scale, view_scale);
  CopyBasis(basis_light, layout.kl, layout.light_form, layout.light_basis_begin(), &glsl.shared_values);
  CopyBasis(basis_view, layout.kv, layout.view_form, layout.view_basis_begin(), &glsl.shared_values);

  glsl.words_per_btfel = layout.btfel_words();
  glsl.btfel_words.resize(TotalSize(table, more) * glsl.words_per_btfel);
  uint32_t* words = PackBtfels(table, layout, light_scale, view_scale, glsl.btfel_words.data());
  for (const BtfelTable* const other : more) {
    words = PackBtfels(*other, layout, light_scale, view_scale, words);
  }
  return glsl;
}

}  // namespace tessera
