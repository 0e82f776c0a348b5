#include "btf/codec/dsh/dsh_glsl.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

constexpr int kMaxBasis = 49;       // l <= 6
constexpr int kCodesPerTexel = 16;  // RGBA32UI
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

// How the function of index l(l+1)+m changes under quarter turns t of the direction: the one of even m by a
// sign, the one of odd m by a sign or, for odd t, into its partner (l, -m).
enum class TurnClass { kSteady, kFlipped, kSwapped };  // |m| = 0, 2, odd modulo 4

int OrderOf(int index) {
  const int l = static_cast<int>(std::sqrt(static_cast<double>(index)));
  return index - l * (l + 1);
}

TurnClass TurnClassOf(int index) {
  const int m = std::abs(OrderOf(index));
  return m % 2 == 1 ? TurnClass::kSwapped : m % 4 == 2 ? TurnClass::kFlipped : TurnClass::kSteady;
}

// The partner's index, and the sign it takes with one quarter turn.
int PartnerOf(int index) {
  return index - 2 * OrderOf(index);
}
int PartnerSign(int index) {
  const int m = OrderOf(index);
  return (std::abs(m) % 4 == 1) == (m > 0) ? 1 : -1;
}

enum class BasisForm {
  kPlain,    // the identity
  kByOrder,  // each function mixes those of its own order m up to its degree, those of -m alike: they turn as
             // the plain ones do
  kGeneral,
};

BasisForm FormOf(const CodecTable& basis, int size) {
  bool is_identity = true;
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const float value = basis.values[i * size + j];
      is_identity &= value == (i == j ? 1.0f : 0.0f);
      if (OrderOf(i) != OrderOf(j) || j > i ? value != 0.0f
                                            : value != basis.values[PartnerOf(i) * size + PartnerOf(j)]) {
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
// angles; then for each view function j the steps and the offsets of its 3 kl codes; then the bases that are
// not the identity.
struct Layout {
  int kl = 0;
  int kv = 0;
  BasisForm light_form = BasisForm::kPlain;
  BasisForm view_form = BasisForm::kPlain;

  [[nodiscard]] bool turns_like_plain() const {
    return light_form != BasisForm::kGeneral && view_form != BasisForm::kGeneral;
  }
  [[nodiscard]] int row_codes() const { return 3 * kl; }
  [[nodiscard]] int row_texels() const { return (row_codes() + 3) / 4; }
  [[nodiscard]] int light_basis_begin() const { return 1 + kv * 2 * row_texels(); }
  [[nodiscard]] int view_basis_begin() const { return light_basis_begin() + BasisTexels(light_form, kl); }
  [[nodiscard]] int num_texels() const { return view_basis_begin() + BasisTexels(view_form, kv); }
  // Words of one BTFel: each view function's codes start at a texel of four words.
  [[nodiscard]] int btfel_row_texels() const { return (row_codes() + kCodesPerTexel - 1) / kCodesPerTexel; }

 private:
  static int BasisTexels(BasisForm form, int size) {
    switch (form) {
      case BasisForm::kPlain:
        return 0;
      case BasisForm::kByOrder: {
        int entries = 0;
        for (int n = static_cast<int>(std::lround(std::sqrt(size))); n > 0; --n) {
          entries += n * (n + 1) / 2;
        }
        return (entries + 3) / 4;
      }
      case BasisForm::kGeneral:
        return size * ((size + 3) / 4);
    }
    return 0;
  }
};

// One weighted sum for BTFels of any turns. With y' = y(turned direction) and x = the partners with their
// signs,
//   y'_i = y_i (steady), e y_i (flipped), k y_i + s x_i (swapped),   e = 1 -1 1 -1, k = 1 0 -1 0, s = 0 1 0
//   -1
// by turn, so the codes are summed by class and the turn comes in once a row: tables and harmonics serve all.
std::string Source(const Layout& layout) {
  const auto component = [](int i) { return std::string(1, kComponent[i]); };
  std::string out;
  absl::StrAppend(&out, "uniform usamplerBuffer btfel_words;\nuniform samplerBuffer codec_values;\n");
  AppendHarmonics("LightHarmonics", layout.kl,
                  layout.light_form == BasisForm::kByOrder ? layout.light_basis_begin() : -1, &out);
  AppendHarmonics("ViewHarmonics", layout.kv,
                  layout.view_form == BasisForm::kByOrder ? layout.view_basis_begin() : -1, &out);
  absl::StrAppend(&out, R"(
vec3 ClampPolar(vec3 d, float cosine, float sine) {
  return d.z < cosine ? vec3(d.xy * (sine / length(d.xy)), cosine) : d;
}

vec3 BlendTurned(ivec4 btfels, ivec4 turns, vec4 weights, int count, vec3 light, vec3 view) {
  vec4 q = texelFetch(codec_values, 0);
  float scale = light.z < q.x ? light.z / q.x : 1.0;
)");
  // A loop of no rows, since llvmpipe leaves loops early but not functions.
  absl::StrAppend(&out, "  int rows = light.z > 0.0 && view.z > 0.0 && count > 0 ? ", layout.kv, " : 0;\n",
                  "  light = ClampPolar(light, q.x, q.y);\n  view = ClampPolar(view, q.z, q.w);\n",
                  "  float yl[", layout.kl, "];\n  float yv[", layout.kv, "];\n",
                  "  LightHarmonics(light, yl);\n  ViewHarmonics(view, yv);\n");
  if (layout.light_form == BasisForm::kGeneral) {
    AppendChangeOfBasis("yl", layout.kl, layout.light_basis_begin(), &out);
  }
  if (layout.view_form == BasisForm::kGeneral) {
    AppendChangeOfBasis("yv", layout.kv, layout.view_basis_begin(), &out);
  }
  // The view's functions by class, (steady, flipped, k part, s part), since rows are counted by a loop.
  absl::StrAppend(&out, "  vec4 classes[", layout.kv, "];\n");
  for (int j = 0; j < layout.kv; ++j) {
    const std::string value = absl::StrCat("yv[", j, "]");
    absl::StrAppend(&out, "  classes[", j, "] = vec4(");
    switch (TurnClassOf(j)) {
      case TurnClass::kSteady:
        absl::StrAppend(&out, value, ", 0.0, 0.0, 0.0);\n");
        break;
      case TurnClass::kFlipped:
        absl::StrAppend(&out, "0.0, ", value, ", 0.0, 0.0);\n");
        break;
      case TurnClass::kSwapped:
        absl::StrAppend(&out, "0.0, 0.0, ", value, ", ", PartnerSign(j) < 0 ? "-" : "", "yv[", PartnerOf(j),
                        "]);\n");
        break;
    }
  }
  // The separable sum, view functions outermost: the light weights times the steps are made once a row and
  // serve every BTFel; the offsets need no BTFel at all. The inner lists are written out, so that llvmpipe
  // keeps them in registers; indexed by a loop they cost several times as much.
  absl::StrAppend(
      &out, "  vec3 sum = vec3(0.0);\n  for (int j = 0; j < rows; ++j) {\n    int table = 1 + j * ",
      2 * layout.row_texels(), ";\n    float w[", layout.row_codes(), "], wx[", layout.row_codes(),
      "];\n    vec3 o0 = vec3(0.0), o2 = vec3(0.0), ok = vec3(0.0), os = vec3(0.0);\n");
  const auto partner = [&](int i) {
    return absl::StrCat(PartnerSign(i) < 0 ? "-" : "", "yl[", PartnerOf(i), "]");
  };
  for (int texel = 0; texel < layout.row_texels(); ++texel) {
    const int end = std::min(4 * texel + 4, layout.row_codes());
    absl::StrAppend(&out, "    q = texelFetch(codec_values, table + ", texel, ");\n");
    for (int n = 4 * texel; n < end; ++n) {
      const int i = n % layout.kl;
      absl::StrAppend(&out, "    w[", n, "] = q.", component(n % 4), " * yl[", i, "];\n");
      if (TurnClassOf(i) == TurnClass::kSwapped) {
        absl::StrAppend(&out, "    wx[", n, "] = q.", component(n % 4), " * ", partner(i), ";\n");
      }
    }
    absl::StrAppend(&out, "    q = texelFetch(codec_values, table + ", layout.row_texels() + texel, ");\n");
    for (int n = 4 * texel; n < end; ++n) {
      const int i = n % layout.kl;
      const std::string channel = component(n / layout.kl);
      const std::string offset = absl::StrCat("q.", component(n % 4), " * ");
      const TurnClass turn_class = TurnClassOf(i);
      const char* into = turn_class == TurnClass::kSteady    ? "o0."
                         : turn_class == TurnClass::kFlipped ? "o2."
                                                             : "ok.";
      absl::StrAppend(&out, "    ", into, channel, " += ", offset, "yl[", i, "];\n");
      if (turn_class == TurnClass::kSwapped) {
        absl::StrAppend(&out, "    os.", channel, " += ", offset, partner(i), ";\n");
      }
    }
  }
  absl::StrAppend(&out, R"(
    for (int n = 0; n < count; ++n) {
      vec3 a0 = o0, a2 = o2, ak = ok, as = os;
      uvec4 u;
      float f;
)");
  absl::StrAppend(&out, "      int first = (btfels[n] * ", layout.kv, " + j) * ", layout.btfel_row_texels(),
                  ";\n");
  for (int n = 0; n < layout.row_codes(); ++n) {
    if (n % kCodesPerTexel == 0) {
      absl::StrAppend(&out, "      u = texelFetch(btfel_words, first + ", n / kCodesPerTexel, ");\n");
    }
    const std::string channel = component(n / layout.kl);
    // By way of int, which vector units convert in one instruction, unlike uint.
    const std::string code =
        absl::StrCat("float(int((u.", component((n % kCodesPerTexel) / 4), " >> ", 8 * (n % 4), ") & 255u))");
    switch (TurnClassOf(n % layout.kl)) {
      case TurnClass::kSteady:
        absl::StrAppend(&out, "      a0.", channel, " += ", code, " * w[", n, "];\n");
        break;
      case TurnClass::kFlipped:
        absl::StrAppend(&out, "      a2.", channel, " += ", code, " * w[", n, "];\n");
        break;
      case TurnClass::kSwapped:
        absl::StrAppend(&out, "      f = ", code, "; ak.", channel, " += f * w[", n, "]; as.", channel,
                        " += f * wx[", n, "];\n");
        break;
    }
  }
  absl::StrAppend(&out, R"(
      int turn = turns[n];
      float e = (turn & 1) != 0 ? -1.0 : 1.0;
      float k = turn == 0 ? 1.0 : turn == 2 ? -1.0 : 0.0;
      float s = turn == 1 ? 1.0 : turn == 3 ? -1.0 : 0.0;
      float y = dot(classes[j], vec4(1.0, e, k, s));
      sum += (weights[n] * y) * (a0 + e * a2 + k * ak + s * as);
    }
  }
  return scale * sum;
}

vec3 BlendBtfels(ivec4 btfels, ivec4 turns, vec4 weights, int count, vec3 light, vec3 view) {
)");
  if (layout.turns_like_plain()) {
    absl::StrAppend(&out, "  return BlendTurned(btfels, turns, weights, count, light, view);\n}\n");
    return out;
  }
  // Functions that do not turn into each other: one sum for each turn, under the turned directions.
  absl::StrAppend(&out, R"(
  vec3 sum = vec3(0.0);
  for (int turn = 0; turn < 4; ++turn) {
    ivec4 group = ivec4(0);
    vec4 group_weights = vec4(0.0);
    int group_count = 0;
    for (int n = 0; n < 4; ++n) {
      if (n < count && turns[n] == turn) {
        group[group_count] = btfels[n];
        group_weights[group_count] = weights[n];
        ++group_count;
      }
    }
    sum += BlendTurned(group, ivec4(0), group_weights, group_count, light, view);
    light.xy = vec2(light.y, -light.x);
    view.xy = vec2(view.y, -view.x);
  }
  return sum;
}
)");
  return out;
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

}  // namespace

absl::StatusOr<CodecGlsl> DshGlsl(const BtfelTable& table) {
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

  // Code n of row j is coefficient (channel kv + j) kl + i with n = channel kl + i.
  const int row_codes = layout.row_codes();
  const auto coefficient = [&](int j, int n) {
    return (static_cast<size_t>(n / layout.kl) * layout.kv + j) * layout.kl + n % layout.kl;
  };
  for (int j = 0; j < layout.kv; ++j) {
    float* row = glsl.shared_values.data() + 4 * (1 + static_cast<ptrdiff_t>(j) * 2 * layout.row_texels());
    for (int n = 0; n < row_codes; ++n) {
      row[n] = table.step[coefficient(j, n)];
      row[4 * layout.row_texels() + n] = table.offset[coefficient(j, n)];
    }
  }
  CopyBasis(basis_light, layout.kl, layout.light_form, layout.light_basis_begin(), &glsl.shared_values);
  CopyBasis(basis_view, layout.kv, layout.view_form, layout.view_basis_begin(), &glsl.shared_values);

  // The codes of a channel and row lie together on both sides. Byte n % 4 of word n / 4 is its bits from
  // 8 (n % 4) on: on the little-endian machines that this is for, bytes in order.
  static_assert(std::endian::native == std::endian::little);
  const int row_words = layout.btfel_row_texels() * 4;
  glsl.words_per_btfel = layout.kv * row_words;
  glsl.btfel_words.resize(table.size() * glsl.words_per_btfel);
  auto* bytes = reinterpret_cast<uint8_t*>(glsl.btfel_words.data());
  for (size_t btfel = 0; btfel < table.size(); ++btfel) {
    const uint8_t* const codes = table.codes.data() + btfel * k;
    for (int j = 0; j < layout.kv; ++j, bytes += 4 * static_cast<ptrdiff_t>(row_words)) {
      for (int channel = 0; channel < 3; ++channel) {
        std::copy_n(codes + coefficient(j, channel * layout.kl), layout.kl, bytes + channel * layout.kl);
      }
    }
  }
  return glsl;
}

}  // namespace tessera
