#include "btf/codec/view_pca/view_pca_glsl.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_range.h"
#include "btf/codec/turns_glsl.h"
#include "btf/codec/view_pca/view_pca_decoder.h"

namespace tessera {
namespace {

constexpr int kCodesPerTexel = 16;  // RGBA32UI
constexpr std::array<char, 4> kComponent = {'x', 'y', 'z', 'w'};

// Sizes that depend on c alone, in texels of four floats or words.
struct Layout {
  int c = 0;

  [[nodiscard]] int view_codes() const { return 3 * (c + 1); }
  [[nodiscard]] int view_texels() const { return (view_codes() + 3) / 4; }  // of steps, or of offsets
  [[nodiscard]] int weight_texels() const { return (c + 3) / 4; }
  [[nodiscard]] int harmonics_texels() const { return (c + 4) / 4; }  // of the mean's weight and the others
  [[nodiscard]] int btfel_view_texels() const { return (view_codes() + kCodesPerTexel - 1) / kCodesPerTexel; }
};

// Texels of codec_values: 0 the limits (cosine and sine of the lights' and the views' largest polar angle);
// 1 where the lights' and the views' cells start, the number of lights and of views; 2 where the weights and
// the quantisation start. A cell is (first entry, number of entries); an entry holds where its triangle
// starts; a triangle is (a, b), (c, 1 / twice its area), (the three indices).
constexpr int kCellsBegin = 3;

std::string Component(int i) {
  return std::string(1, kComponent[i]);
}

std::string Head() {
  std::string out = R"(uniform usamplerBuffer btfel_words;
uniform samplerBuffer codec_values;

float Cross(vec2 a, vec2 b) { return a.x * b.y - a.y * b.x; }

vec3 Nearer(vec2 a, vec2 b, vec3 at_a, vec3 at_b, inout float best, vec3 weight) {
  vec2 edge = b - a;
  float square = dot(edge, edge);
  float t = square > 0.0 ? clamp(-dot(a, edge) / square, 0.0, 1.0) : 0.0;
  vec2 to = a + t * edge;
  float distance = dot(to, to);
  bool is_nearer = distance < best;
  best = is_nearer ? distance : best;
  return is_nearer ? mix(at_a, at_b, t) : weight;
}

// As HemisphereInterpolator::Locate.
void Locate(vec3 d, vec2 limit, int cells, out ivec3 index, out vec3 weight) {
  d = d.z < limit.x ? vec3(d.xy * (limit.y / length(d.xy)), limit.x) : d;
  vec2 p = d.xy / (1.0 + d.z);
)";
  absl::StrAppend(&out, "  ivec2 cell = clamp(ivec2((p + 1.0) * ", HemisphereInterpolator::kCellsPerSide / 2,
                  ".0), ivec2(0), ivec2(", HemisphereInterpolator::kCellsPerSide - 1,
                  "));\n  vec4 q = texelFetch(codec_values, cells + cell.y * ",
                  HemisphereInterpolator::kCellsPerSide, " + cell.x);\n", R"(  int entry = int(q.x);
  int end = entry + int(q.y);
  float best = 1e30;
  index = ivec3(0);
  weight = vec3(1.0, 0.0, 0.0);
  do {
    int triangle = int(texelFetch(codec_values, entry).x);
    q = texelFetch(codec_values, triangle);
    vec2 a = q.xy - p, b = q.zw - p;
    q = texelFetch(codec_values, triangle + 1);
    vec2 c = q.xy - p;
    vec3 w = vec3(Cross(b, c), Cross(c, a), 0.0) * q.z;
    w.z = 1.0 - w.x - w.y;
    float before = best;
    if (q.z > 0.0 && min(w.x, min(w.y, w.z)) >= 0.0) {
      best = 0.0;
      weight = w;
    } else {
      weight = Nearer(a, b, vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), best, weight);
      weight = Nearer(b, c, vec3(0.0, 1.0, 0.0), vec3(0.0, 0.0, 1.0), best, weight);
      weight = Nearer(c, a, vec3(0.0, 0.0, 1.0), vec3(1.0, 0.0, 0.0), best, weight);
    }
    q = texelFetch(codec_values, triangle + 2);
    index = best < before ? ivec3(q.xyz) : index;
  } while (++entry < end && best > 0.0);
}
)");
  return out;
}

// One of the three measured views around a view: its quantisation times weight_of(n), the weight of the
// view's code n under the light at hand, then its part in each BTFel's value.
void AppendView(const Layout& layout, const std::function<std::string(int n)>& weight_of, std::string* out) {
  absl::StrAppend(out, "    float w[", layout.view_codes(), "];\n    vec3 offset = vec3(0.0);\n",
                  "    int table = quantisation_begin + v * ", 2 * layout.view_texels(), ";\n");
  for (int texel = 0; texel < layout.view_texels(); ++texel) {
    const int end = std::min(4 * texel + 4, layout.view_codes());
    absl::StrAppend(out, "    q = texelFetch(codec_values, table + ", texel, ");\n");
    for (int n = 4 * texel; n < end; ++n) {
      absl::StrAppend(out, "    w[", n, "] = q.", Component(n % 4), " * ", weight_of(n), ";\n");
    }
    absl::StrAppend(out, "    q = texelFetch(codec_values, table + ", layout.view_texels() + texel, ");\n");
    for (int n = 4 * texel; n < end; ++n) {
      absl::StrAppend(out, "    offset.", Component(n / (layout.c + 1)), " += q.", Component(n % 4), " * ",
                      weight_of(n), ";\n");
    }
  }
  absl::StrAppend(out, "    do {\n      int first = (btfels[n] * num_views + v) * ",
                  layout.btfel_view_texels(), ";\n      vec3 value = offset;\n      uvec4 u;\n");
  for (int n = 0; n < layout.view_codes(); ++n) {
    if (n % kCodesPerTexel == 0) {
      absl::StrAppend(out, "      u = texelFetch(btfel_words, first + ", n / kCodesPerTexel, ");\n");
    }
    absl::StrAppend(out, "      value.", Component(n / (layout.c + 1)), " += float(int(u.",
                    Component(n % kCodesPerTexel / 4), " >> ", 8 * (n % 4), ") & 255) * w[", n, "];\n");
  }
  absl::StrAppend(out, R"(      sum += (weights[n] * view_weight[s]) * value;
    } while (++n < count);
)");
}

std::string Source(const Layout& layout) {
  std::string out = absl::StrCat(Head(), kUnturnedDirectionGlsl, kDirectionIncidenceGlsl, R"(
// BTFels of no turn.
vec3 BlendUnturned(ivec4 btfels, vec4 weights, int count, Incidence light, vec3 view) {
  vec4 limits = texelFetch(codec_values, 0);
  vec4 q = texelFetch(codec_values, 1);
  int num_lights = int(q.z), num_views = int(q.w);
  float scale = light.z < limits.x ? light.z / limits.x : 1.0;
  ivec3 light_index, view_index;
  vec3 light_weight, view_weight;
  Locate(light, limits.xy, int(q.x), light_index, light_weight);
  Locate(view, limits.zw, int(q.y), view_index, view_weight);
  q = texelFetch(codec_values, 2);
  int weights_begin = int(q.x), quantisation_begin = int(q.y);
  bool is_lit = light.z > 0.0 && view.z > 0.0;
  int corners = is_lit ? 3 : 1, s = 0;
  vec3 sum = vec3(0.0);
  do {
    int v = view_index[s];
    int n = 0;
)");
  // The weights of the eigen-textures under this light; that of the mean is 1.
  absl::StrAppend(&out, "    vec4 a[", std::max(1, layout.weight_texels()), "];\n");
  absl::StrAppend(&out, "    int row = weights_begin + v * num_lights * ", layout.weight_texels(), ";\n");
  for (int t = 0; t < layout.weight_texels(); ++t) {
    absl::StrAppend(&out, "    a[", t, "] = ");
    for (int r = 0; r < 3; ++r) {
      absl::StrAppend(&out, r > 0 ? " + " : "", "light_weight.", Component(r),
                      " * texelFetch(codec_values, row + light_index.", Component(r), " * ",
                      layout.weight_texels(), " + ", t, ")");
    }
    absl::StrAppend(&out, ";\n");
  }
  AppendView(
      layout,
      [&](int n) {
        const int m = n % (layout.c + 1);
        return m == 0 ? std::string("1.0") : absl::StrCat("a[", (m - 1) / 4, "].", Component((m - 1) % 4));
      },
      &out);
  absl::StrAppend(&out, "  } while (++s < corners);\n  return is_lit ? scale * sum : vec3(0.0);\n}\n",
                  kBlendByTurnGlsl);
  return out;
}

std::string SourceOfHarmonics(const Layout& layout, int n) {
  std::string out = absl::StrCat(Head(), "uniform samplerBuffer harmonics_values;\n", kUnturnedDirectionGlsl,
                                 HarmonicsIncidenceGlsl(n), R"(
// BTFels of no turn.
vec3 BlendUnturned(ivec4 btfels, vec4 weights, int count, Incidence light, vec3 view) {
  vec4 limits = texelFetch(codec_values, 0);
  vec4 q = texelFetch(codec_values, 1);
  int num_views = int(q.w);
  ivec3 view_index;
  vec3 view_weight;
  Locate(view, limits.zw, int(q.y), view_index, view_weight);
  int quantisation_begin = int(texelFetch(codec_values, 2).y);
  bool is_lit = view.z > 0.0;
  int corners = is_lit ? 3 : 1, s = 0;
  vec3 sum = vec3(0.0);
  do {
    int v = view_index[s];
    int n = 0;
)");
  // The weights of the mean and the eigen-textures under this light, for each channel.
  absl::StrAppend(&out, "    vec3 a[", layout.c + 1, "];\n    int row = v * ", n * layout.harmonics_texels(),
                  ";\n");
  for (int i = 0; i < n; ++i) {
    for (int m = 0; m <= layout.c; ++m) {
      if (m % 4 == 0) {
        absl::StrAppend(&out, "    q = texelFetch(harmonics_values, row + ",
                        i * layout.harmonics_texels() + m / 4, ");\n");
      }
      absl::StrAppend(&out, "    a[", m, "] ", i == 0 ? "" : "+", "= q.", Component(m % 4), " * light[", i,
                      "];\n");
    }
  }
  AppendView(
      layout,
      [&](int code) {
        return absl::StrCat("a[", code % (layout.c + 1), "].", Component(code / (layout.c + 1)));
      },
      &out);
  absl::StrAppend(&out, "  } while (++s < corners);\n  return is_lit ? sum : vec3(0.0);\n}\n",
                  kBlendByTurnGlsl);
  return out;
}

// Cells, entries and triangles; entries and triangles hold texel numbers of the whole.
void AppendInterpolator(const HemisphereInterpolator& interpolator, std::vector<float>& values) {
  const auto append = [&values](double x, double y, double z, double w) {
    for (const double value : {x, y, z, w}) {
      values.push_back(static_cast<float>(value));
    }
  };
  const std::vector<int>& begin = interpolator.cell_begin();
  const double entries_begin = static_cast<double>(values.size() / 4 + begin.size() - 1);
  const double triangles_begin = entries_begin + static_cast<double>(interpolator.cell_triangles().size());
  for (size_t cell = 0; cell + 1 < begin.size(); ++cell) {
    append(entries_begin + begin[cell], begin[cell + 1] - begin[cell], 0.0, 0.0);
  }
  for (const int triangle : interpolator.cell_triangles()) {
    append(triangles_begin + 3.0 * triangle, 0.0, 0.0, 0.0);
  }
  for (const HemisphereInterpolator::Triangle& triangle : interpolator.triangles()) {
    const auto& [a, b, c] = triangle.corner;
    append(a.x(), a.y(), b.x(), b.y());
    append(c.x(), c.y(), triangle.inverse_area, 0.0);
    append(triangle.index[0], triangle.index[1], triangle.index[2], 0.0);
  }
}

// The table's codes, each view's from a texel on; `words` are 0 and have room for them. Where they end.
uint32_t* PackBtfels(const BtfelTable& table, const Layout& layout, uint32_t* words) {
  const uint8_t* const end = table.codes.data() + table.codes.size();
  for (const uint8_t* codes = table.codes.data(); codes != end; codes += layout.view_codes()) {
    for (int n = 0; n < layout.view_codes(); ++n) {
      words[n / 4] |= static_cast<uint32_t>(codes[n]) << (8 * (n % 4));
    }
    words += static_cast<ptrdiff_t>(layout.btfel_view_texels()) * 4;
  }
  return words;
}

}  // namespace

absl::StatusOr<CodecGlsl> ViewPcaGlsl(const BtfelTable& table, std::span<const BtfelTable* const> more) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<ViewPcaDecoder> decoder, ViewPcaDecoder::Create(table));
  const Layout layout{decoder->num_eigen_textures()};
  const size_t k = static_cast<size_t>(table.num_coefficients);
  if (table.codes.size() % k != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(table.codes.size(), " codes are not a multiple of ", k, " coefficients"));
  }
  TESSERA_RETURN_IF_ERROR(CheckSameCoefficients(table, more));
  for (const BtfelTable* const other : more) {
    if (other->offset != table.offset || other->step != table.step) {
      return absl::InvalidArgumentError("further BTFels of view-pca have another quantisation");
    }
  }
  CodecGlsl glsl;
  glsl.source = Source(layout);

  std::vector<float>& values = glsl.shared_values;
  values.assign(4 * size_t{kCellsBegin}, 0.0F);
  values[0] = static_cast<float>(decoder->lights().cos_limit());
  values[1] = static_cast<float>(decoder->lights().sin_limit());
  values[2] = static_cast<float>(decoder->views().cos_limit());
  values[3] = static_cast<float>(decoder->views().sin_limit());
  values[4] = kCellsBegin;
  AppendInterpolator(decoder->lights(), values);
  values[5] = static_cast<float>(values.size() / 4);
  AppendInterpolator(decoder->views(), values);
  values[6] = static_cast<float>(decoder->num_lights());
  values[7] = static_cast<float>(decoder->num_views());
  values[8] = static_cast<float>(values.size() / 4);
  const size_t num_rows = static_cast<size_t>(decoder->num_views()) * decoder->num_lights();
  for (size_t row = 0; row < num_rows; ++row) {
    const auto weights = decoder->light_weights().begin() + static_cast<ptrdiff_t>(row * layout.c);
    values.insert(values.end(), weights, weights + layout.c);
    values.resize((values.size() + 3) / 4 * 4, 0.0F);
  }
  values[9] = static_cast<float>(values.size() / 4);
  for (int view = 0; view < decoder->num_views(); ++view) {
    for (const std::vector<float>* of : {&table.step, &table.offset}) {
      const auto first = of->begin() + static_cast<ptrdiff_t>(view) * layout.view_codes();
      values.insert(values.end(), first, first + layout.view_codes());
      values.resize((values.size() + 3) / 4 * 4, 0.0F);
    }
  }

  const int view_words = 4 * layout.btfel_view_texels();
  glsl.words_per_btfel = decoder->num_views() * view_words;
  glsl.btfel_words.resize(TotalSize(table, more) * glsl.words_per_btfel);
  uint32_t* words = PackBtfels(table, layout, glsl.btfel_words.data());
  for (const BtfelTable* const other : more) {
    words = PackBtfels(*other, layout, words);
  }
  return glsl;
}

absl::StatusOr<HarmonicsGlsl> ViewPcaHarmonicsGlsl(const BtfelTable& table, int n) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<ViewPcaDecoder> decoder, ViewPcaDecoder::Create(table));
  const Layout layout{decoder->num_eigen_textures()};
  HarmonicsGlsl glsl{.source = SourceOfHarmonics(layout, n)};
  const Eigen::MatrixXd integrals = decoder->LightIntegrals().leftCols(n);
  const int num_lights = decoder->num_lights();
  const size_t row_floats = 4 * static_cast<size_t>(layout.harmonics_texels());
  glsl.values.assign(decoder->num_views() * n * row_floats, 0.0F);
  float* row = glsl.values.data();
  for (int view = 0; view < decoder->num_views(); ++view) {
    const Eigen::Map<const Eigen::MatrixXf> weights(
        decoder->light_weights().data() + static_cast<size_t>(view) * num_lights * layout.c, layout.c,
        num_lights);
    const Eigen::MatrixXd under = weights.cast<double>() * integrals;
    for (int i = 0; i < n; ++i, row += row_floats) {
      row[0] = static_cast<float>(integrals.col(i).sum());
      for (int m = 0; m < layout.c; ++m) {
        row[m + 1] = static_cast<float>(under(m, i));
      }
    }
  }
  return glsl;
}

}  // namespace tessera
