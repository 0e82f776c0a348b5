#include "btf/codec/dsh/dsh_glsl.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
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

bool IsIdentity(const CodecTable& basis, int size) {
  for (int i = 0; i < size * size; ++i) {
    if (basis.values[i] != (i % (size + 1) == 0 ? 1.0f : 0.0f)) {
      return false;
    }
  }
  return true;
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

// Whether the mapped functions turn as the plain ones do: each mixes only functions of its own order m, those
// of -m alike.
bool TurnsLikePlain(const CodecTable& basis, int size) {
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      const float value = basis.values[i * size + j];
      if (OrderOf(i) != OrderOf(j) ? value != 0.0f
                                   : value != basis.values[PartnerOf(i) * size + PartnerOf(j)]) {
        return false;
      }
    }
  }
  return true;
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

// `void name(vec3 d, out float y[size])`: plain real spherical harmonics without the Condon-Shortley sign,
// index l(l+1)+m, as a straight line of code. The azimuthal factors c_m + i s_m = (x + iy)^m carry sin^m; the
// rest is the recursion of normalised associated Legendre functions over l.
void AppendHarmonics(const std::string& name, int size, std::string* out) {
  const int orders = static_cast<int>(std::lround(std::sqrt(size)));
  absl::StrAppend(out, "void ", name, "(vec3 d, out float y[", size,
                  "]) {\n  float c = 1.0, s = 0.0, t, p0, p1;\n");
  double diagonal = std::sqrt(0.25 / kPi);
  for (int m = 0; m < orders; ++m) {
    if (m > 0) {
      diagonal *= std::sqrt((2.0 * m + 1.0) / (2.0 * m));
      absl::StrAppend(out, "  t = d.x * c - d.y * s; s = d.x * s + d.y * c; c = t;\n");
    }
    for (int l = m; l < orders; ++l) {
      if (l == m) {
        absl::StrAppend(out, "  p1 = ", Literal(diagonal * (m > 0 ? std::sqrt(2.0) : 1.0)), ";\n");
      } else if (l == m + 1) {
        absl::StrAppend(out, "  p0 = p1; p1 = ", Literal(std::sqrt(2.0 * m + 3.0)), " * d.z * p0;\n");
      } else {
        const double ll = static_cast<double>(l) * l;
        const double below = (l - 1.0) * (l - 1.0);
        const double mm = static_cast<double>(m) * m;
        const double a = std::sqrt((4.0 * ll - 1.0) / (ll - mm));
        const double b = std::sqrt((below - mm) / (4.0 * below - 1.0));
        absl::StrAppend(out, "  t = ", Literal(a), " * d.z * p1 - ", Literal(a * b),
                        " * p0; p0 = p1; p1 = t;\n");
      }
      absl::StrAppend(out, "  y[", l * (l + 1) + m, "] = p1 * c;\n");
      if (m > 0) {
        absl::StrAppend(out, "  y[", l * (l + 1) - m, "] = p1 * s;\n");
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
  bool plain_light = true;
  bool plain_view = true;
  bool turns_like_plain = true;

  [[nodiscard]] int row_codes() const { return 3 * kl; }
  [[nodiscard]] int row_texels() const { return (row_codes() + 3) / 4; }
  [[nodiscard]] int light_basis_begin() const { return 1 + kv * 2 * row_texels(); }
  [[nodiscard]] int view_basis_begin() const {
    return light_basis_begin() + (plain_light ? 0 : kl * ((kl + 3) / 4));
  }
  [[nodiscard]] int num_texels() const { return view_basis_begin() + (plain_view ? 0 : kv * ((kv + 3) / 4)); }
  // Words of one BTFel: each view function's codes start at a texel of four words.
  [[nodiscard]] int btfel_row_texels() const { return (row_codes() + kCodesPerTexel - 1) / kCodesPerTexel; }
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
  AppendHarmonics("LightHarmonics", layout.kl, &out);
  AppendHarmonics("ViewHarmonics", layout.kv, &out);
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
  if (!layout.plain_light) {
    AppendChangeOfBasis("yl", layout.kl, layout.light_basis_begin(), &out);
  }
  if (!layout.plain_view) {
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
    const std::string code =
        absl::StrCat("float((u.", component((n % kCodesPerTexel) / 4), " >> ", 8 * (n % 4), ") & 255u)");
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
  if (layout.turns_like_plain) {
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

void CopyBasis(const CodecTable& basis, int size, int first_texel, std::vector<float>* values) {
  const int stride = (size + 3) / 4 * 4;
  for (int i = 0; i < size; ++i) {
    std::copy_n(
        basis.values.begin() + static_cast<ptrdiff_t>(i) * size, size,
        values->begin() + 4 * static_cast<ptrdiff_t>(first_texel) + static_cast<ptrdiff_t>(i) * stride);
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
  layout.plain_light = IsIdentity(basis_light, layout.kl);
  layout.plain_view = IsIdentity(basis_view, layout.kv);
  layout.turns_like_plain = TurnsLikePlain(basis_light, layout.kl) && TurnsLikePlain(basis_view, layout.kv);

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
  if (!layout.plain_light) {
    CopyBasis(basis_light, layout.kl, layout.light_basis_begin(), &glsl.shared_values);
  }
  if (!layout.plain_view) {
    CopyBasis(basis_view, layout.kv, layout.view_basis_begin(), &glsl.shared_values);
  }

  std::vector<uint32_t> order;  // of the codes in a BTFel's words: coefficient by [j][n]
  for (int j = 0; j < layout.kv; ++j) {
    for (int n = 0; n < row_codes; ++n) {
      order.push_back(static_cast<uint32_t>(coefficient(j, n)));
    }
  }
  const int row_words = layout.btfel_row_texels() * 4;
  glsl.words_per_btfel = layout.kv * row_words;
  glsl.btfel_words.resize(table.size() * glsl.words_per_btfel);
  for (size_t btfel = 0; btfel < table.size(); ++btfel) {
    const uint8_t* codes = table.codes.data() + btfel * k;
    uint32_t* words = glsl.btfel_words.data() + btfel * glsl.words_per_btfel;
    for (int j = 0; j < layout.kv; ++j) {
      const uint32_t* row_order = order.data() + static_cast<ptrdiff_t>(j) * row_codes;
      for (int n = 0; n < row_codes; ++n) {
        words[n / 4] |= static_cast<uint32_t>(codes[row_order[n]]) << (8 * (n % 4));
      }
      words += row_words;
    }
  }
  return glsl;
}

}  // namespace tessera
