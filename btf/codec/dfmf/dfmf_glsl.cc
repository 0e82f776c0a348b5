#include "btf/codec/dfmf/dfmf_glsl.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>
#include <absl/strings/substitute.h>

#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_range.h"
#include "btf/codec/dfmf/dfmf_decoder.h"
#include "btf/codec/turns_glsl.h"

namespace tessera {
namespace {

// Factors, and codes, that one step of the shader's loops takes: one texel of 16-bit numbers.
constexpr int kGroup = 8;
constexpr float kMostCode = 32767.0F;

int Groups(int count) {
  return (count + kGroup - 1) / kGroup;
}

// Where things lie. `codec_values`: the limits, the three colour axes, then for each group the scale and the
// offset of its factors. `codec_words`: for each pair of nodes a texel for each group, luminance first, then
// either chrominance. `btfel_words`: for each BTFel a texel for each group of coefficients.
struct Layout {
  int luma_groups = 0;
  int chroma_groups = 0;
  int light_nodes = 0;  // along a side
  int view_nodes = 0;

  explicit Layout(const DfmfDecoder& decoder)
      : luma_groups(Groups(decoder.luma_rank())),
        chroma_groups(Groups(decoder.chroma_rank())),
        light_nodes(decoder.light_grid().nodes_per_side()),
        view_nodes(decoder.view_grid().nodes_per_side()) {}

  [[nodiscard]] int num_groups() const { return luma_groups + 2 * chroma_groups; }
  [[nodiscard]] size_t num_pairs() const {
    return static_cast<size_t>(light_nodes) * light_nodes * view_nodes * view_nodes;
  }
  [[nodiscard]] int btfel_texels() const { return luma_groups + chroma_groups; }
};

// Factors under harmonics, `harmonics_words`: for each view node the groups of luminance, a texel for each
// harmonic; then those of chrominance, for each of the first harmonics a texel for either, for each of the
// others, which matter less, one of bytes for both. `harmonics_values`: what one step is worth, of each group
// of luminance; of each of chrominance that of either in 16 bits, then in bytes.
struct HarmonicsLayout {
  int luma_groups = 0;
  int chroma_groups = 0;
  int n = 0;

  [[nodiscard]] int num_low() const { return std::min(n, 9); }       // degrees 0 to 2
  [[nodiscard]] int chroma_texels() const { return num_low() + n; }  // of a group
  [[nodiscard]] int luma_texels() const { return luma_groups * n; }
  [[nodiscard]] int texels() const { return luma_texels() + chroma_groups * chroma_texels(); }  // of a node
};

constexpr char kHead[] = R"(
uniform usamplerBuffer btfel_words;
uniform samplerBuffer codec_values;
uniform usamplerBuffer codec_words;

// The three nodes around a direction and their weights; btf/codec/FORMAT.md, codec dfmf.
void FindNodes(vec3 d, float by_covered, int side, out ivec3 nodes, out vec3 weights) {
  float radius = min(atan(length(d.xy), d.z) * by_covered, 1.0);
  bool is_a = abs(d.y) <= abs(d.x);
  vec2 p = is_a ? d.xy : d.yx;  // the longer one first
  float major = p.x < 0.0 ? -radius : radius;
  float minor = p.x == 0.0 ? 0.0 : major * atan(p.y / p.x) * 1.273239544735163;
  int center = side >> 1;
  vec2 at = ((is_a ? vec2(major, minor) : vec2(minor, major)) + 1.0) * float(center);
  ivec2 cell = clamp(ivec2(at), ivec2(0), ivec2(side - 2));
  float f = at.x - float(cell.x), g = at.y - float(cell.y);
  int first = cell.x * side + cell.y;
  bool inward = (cell.x < center) == (cell.y < center);
  bool low = inward ? f >= g : f + g <= 1.0;
  nodes = first + (inward ? ivec3(0, low ? side : 1, side + 1) : ivec3(low ? 0 : side + 1, side, 1));
  weights = inward ? (low ? vec3(1.0 - f, f - g, g) : vec3(1.0 - g, g - f, f))
                   : (low ? vec3(1.0 - f - g, f, g) : vec3(f + g - 1.0, 1.0 - g, 1.0 - f));
}

// The signed 16-bit codes of four words, low + 2^16 high, 2^16 times too high, which saves moving them down. The higher
// ones have what the lower ones are of 2^16 as well: AddBits packs them so.
vec4 Low(uvec4 u) { return vec4(ivec4(u << 16)); }
vec4 High(uvec4 u) { return vec4(ivec4(u)); }
)";

// The factors of group `group`: even ones in `even`, odd ones in `odd`.
std::string Interpolate(const std::string& group, const std::string& suffix) {
  std::string out = absl::Substitute("    vec4 even$0 = vec4(0.0), odd$0 = vec4(0.0);\n", suffix);
  for (int i = 0; i < 9; ++i) {
    absl::StrAppend(&out, absl::Substitute("    factors[$0] = texelFetch(codec_words, words$1[$2] + $3);\n",
                                           i, i / 3, i % 3, group));
  }
  for (int i = 0; i < 9; ++i) {
    absl::StrAppend(&out,
                    absl::Substitute("    even$0 += pair$1[$2] * Low(factors[$3]); odd$0 += pair$1[$2] * "
                                     "High(factors[$3]);\n",
                                     suffix, i / 3, i % 3, i));
  }
  absl::StrAppend(&out,
                  absl::Substitute("    q = texelFetch(codec_values, 4 + $0);\n    even$1 = even$1 * q.x "
                                   "+ q.y; odd$1 = odd$1 * q.x + q.y;\n",
                                   group, suffix));
  return out;
}

// The weighted sum of the BTFels' codes in group `group`.
std::string BlendCodes(const std::string& group, int btfel_texels) {
  return absl::Substitute(R"(    vec4 even_codes = vec4(0.0), odd_codes = vec4(0.0);
    n = 0;
    do {
      u = texelFetch(btfel_words, btfels[n] * $1 + $0);
      even_codes += weights[n] * Low(u);
      odd_codes += weights[n] * High(u);
    } while (++n < count);
)",
                          group, btfel_texels);
}

std::string Source(const Layout& layout) {
  std::string out = absl::StrCat(kHead, kUnturnedDirectionGlsl, kDirectionIncidenceGlsl);
  absl::StrAppend(
      &out, absl::Substitute(R"(
vec3 BlendUnturned(ivec4 btfels, vec4 weights, int count, Incidence light, vec3 view) {
  vec4 limits = texelFetch(codec_values, 0);
  bool is_lit = light.z > 0.0 && view.z > 0.0 && count > 0;
  ivec3 light_nodes, view_nodes;
  vec3 light_weights, view_weights;
  FindNodes(light, limits.y, $0, light_nodes, light_weights);
  FindNodes(view, limits.z, $1, view_nodes, view_weights);
  ivec3 pairs0 = light_nodes.x * $2 + view_nodes, pairs1 = light_nodes.y * $2 + view_nodes;
  ivec3 pairs2 = light_nodes.z * $2 + view_nodes;
  vec3 pair0 = light_weights.x * view_weights, pair1 = light_weights.y * view_weights;
  vec3 pair2 = light_weights.z * view_weights;
  vec3 sum = vec3(0.0);
)",
                             layout.light_nodes, layout.view_nodes, layout.view_nodes * layout.view_nodes));
  for (int i = 0; i < 3; ++i) {
    absl::StrAppend(&out, absl::Substitute("  ivec3 words$0 = pairs$0 * $1;\n", i, layout.num_groups()));
  }
  absl::StrAppend(&out, "  uvec4 u, factors[9];\n  vec4 q;\n  int n, g = 0;\n  do {\n", Interpolate("g", ""),
                  BlendCodes("g", layout.btfel_texels()),
                  "    sum.x += dot(even, even_codes) + dot(odd, odd_codes);\n  } while (++g < ",
                  layout.luma_groups, ");\n");
  if (layout.chroma_groups > 0) {
    const std::string first = absl::StrCat("g + ", layout.luma_groups);
    absl::StrAppend(&out, "  g = 0;\n  do {\n", Interpolate(first, "1"),
                    Interpolate(absl::StrCat("g + ", layout.luma_groups + layout.chroma_groups), "2"),
                    BlendCodes(first, layout.btfel_texels()),
                    "    sum.y += dot(even1, even_codes) + dot(odd1, odd_codes);\n"
                    "    sum.z += dot(even2, even_codes) + dot(odd2, odd_codes);\n  } while (++g < ",
                    layout.chroma_groups, ");\n");
  }
  absl::StrAppend(&out, R"(
  float scale = light.z < limits.x ? light.z / limits.x : 1.0;
  vec3 value = sum.x * texelFetch(codec_values, 1).xyz + sum.y * texelFetch(codec_values, 2).xyz +
               sum.z * texelFetch(codec_values, 3).xyz;
  return is_lit ? scale * value : vec3(0.0);
}
)",
                  kBlendByTurnGlsl);
  return out;
}

// GLSL of what words u0, u1 and u2 of the three nodes make of the blended codes, read by `low` and `high`.
std::string AtNodes(const std::string& low, const std::string& high) {
  const auto at = [&](int node) {
    return absl::Substitute("dot($0(u$2), even_codes) + dot($1(u$2), odd_codes)", low, high, node);
  };
  return absl::StrCat("vec3(", at(0), ", ", at(1), ", ", at(2), ")");
}

// Adds to the colour `sum` what words `texel` of the three nodes and the blended codes are under harmonic
// `i`.
std::string AddAtNodes(int texel, const std::string& sum, const std::string& low, const std::string& high,
                       int i) {
  return absl::Substitute(R"(    u0 = texelFetch(harmonics_words, at.x + $0);
    u1 = texelFetch(harmonics_words, at.y + $0);
    u2 = texelFetch(harmonics_words, at.z + $0);
    $1 += dot(view_weights, $2) * light[$3];
)",
                          texel, sum, AtNodes(low, high), i);
}

// Adds to the colour `luma` what the blended codes of group g are under each of `n` harmonics.
std::string AddLumaUnderHarmonics(int n) {
  std::string out = absl::Substitute("    at = words + g * $0;\n    of_group = vec3(0.0);\n", n);
  for (int i = 0; i < n; ++i) {
    absl::StrAppend(&out, AddAtNodes(i, "of_group", "Low", "High", i));
  }
  absl::StrAppend(&out, "    luma += texelFetch(harmonics_values, g).x * of_group;\n");
  return out;
}

// Likewise both chrominances, to `first_chroma` and `second_chroma`.
std::string AddChromaUnderHarmonics(const HarmonicsLayout& harmonics) {
  std::string out = absl::Substitute(
      "    at = words + $0 + g * $1;\n    of_group = of_second = high_first = high_second = vec3(0.0);\n",
      harmonics.luma_texels(), harmonics.chroma_texels());
  for (int i = 0; i < harmonics.num_low(); ++i) {
    absl::StrAppend(&out, AddAtNodes(2 * i, "of_group", "Low", "High", i),
                    AddAtNodes(2 * i + 1, "of_second", "Low", "High", i));
  }
  for (int i = harmonics.num_low(); i < harmonics.n; ++i) {
    absl::StrAppend(&out, AddAtNodes(harmonics.num_low() + i, "high_first", "Byte0", "Byte1", i),
                    absl::Substitute("    high_second += dot(view_weights, $0) * light[$1];\n",
                                     AtNodes("Byte2", "High"), i));
  }
  absl::StrAppend(&out, absl::Substitute(R"(    scales = texelFetch(harmonics_values, $0 + g);
    first_chroma += scales.x * of_group + scales.z * high_first;
    second_chroma += scales.y * of_second + scales.w * high_second;
)",
                                         harmonics.luma_groups));
  return out;
}

std::string SourceOfHarmonics(const Layout& layout, const HarmonicsLayout& harmonics) {
  std::string out = absl::StrCat(
      kHead, "uniform samplerBuffer harmonics_values;\nuniform usamplerBuffer harmonics_words;\n",
      kUnturnedDirectionGlsl, HarmonicsIncidenceGlsl(harmonics.n),
      absl::Substitute(R"(
// Signed bytes of four words, 2^24 times too high; the highest is High's.
vec4 Byte0(uvec4 u) { return vec4(ivec4(u << 24)); }
vec4 Byte1(uvec4 u) { return vec4(ivec4(u << 16)); }
vec4 Byte2(uvec4 u) { return vec4(ivec4(u << 8)); }

vec3 BlendUnturned(ivec4 btfels, vec4 weights, int count, Incidence light, vec3 view) {
  bool is_lit = view.z > 0.0 && count > 0;
  ivec3 view_nodes, at;
  vec3 view_weights, of_group, of_second, high_first, high_second;
  vec3 luma = vec3(0.0), first_chroma = vec3(0.0), second_chroma = vec3(0.0);
  vec4 scales;
  FindNodes(view, texelFetch(codec_values, 0).z, $0, view_nodes, view_weights);
  ivec3 words = view_nodes * $1;
  uvec4 u, u0, u1, u2;
  int n, g = 0;
  do {
)",
                       layout.view_nodes, harmonics.texels()),
      BlendCodes("g", layout.btfel_texels()), AddLumaUnderHarmonics(harmonics.n), "  } while (++g < ",
      layout.luma_groups, ");\n");
  if (layout.chroma_groups > 0) {
    const std::string first = absl::StrCat("g + ", layout.luma_groups);
    absl::StrAppend(&out, "  g = 0;\n  do {\n", BlendCodes(first, layout.btfel_texels()),
                    AddChromaUnderHarmonics(harmonics), "  } while (++g < ", layout.chroma_groups, ");\n");
  }
  absl::StrAppend(&out, R"(
  vec3 value = luma * texelFetch(codec_values, 1).xyz + first_chroma * texelFetch(codec_values, 2).xyz +
               second_chroma * texelFetch(codec_values, 3).xyz;
  return is_lit ? value : vec3(0.0);
}
)",
                  kBlendByTurnGlsl);
  return out;
}

// Adds a signed code to a word, times 2^shift, nearest to the value with what is below it there, which
// shaders read along. Lower codes come first.
void AddBits(float value, int shift, float most, uint32_t& word) {
  const auto below = static_cast<int32_t>(shift == 0 ? 0U : word << (32 - shift));
  const double fraction = std::ldexp(static_cast<double>(below), -32);
  const auto code = static_cast<int>(
      std::clamp(std::round(value - fraction), -static_cast<double>(most), static_cast<double>(most)));
  word += static_cast<uint32_t>(code) << shift;
}

// Likewise a code of 16 bits: the lower half where `place` is even, else the higher.
void AddCode(float value, size_t place, uint32_t& word) {
  AddBits(value, 16 * static_cast<int>(place % 2), kMostCode, word);
}

// Factors of one group in the order of the table: the first, their number, the first coefficient they
// multiply.
struct Group {
  int factor = 0;
  int count = 0;
  int coefficient = 0;
};

std::vector<Group> GroupsOf(const DfmfDecoder& decoder) {
  std::vector<Group> groups;
  const auto add = [&groups](int factor, int coefficient, int rank) {
    for (int i = 0; i < rank; i += kGroup) {
      groups.push_back({factor + i, std::min(kGroup, rank - i), coefficient + i});
    }
  };
  const int r = decoder.luma_rank();
  const int q = decoder.chroma_rank();
  add(0, 0, r);
  add(r, r, q);
  add(r + q, r, q);
  return groups;
}

// `scales`: what one step of each coefficient's 16-bit code is worth.
void PackFactors(const DfmfDecoder& decoder, std::span<const float> scales, const Layout& layout,
                 CodecGlsl& glsl) {
  const std::span<const float> grid = decoder.grid();
  const int num_factors = decoder.num_factors();
  const std::vector<Group> groups = GroupsOf(decoder);
  glsl.shared_words.resize(layout.num_pairs() * groups.size() * 4);
  for (size_t g = 0; g < groups.size(); ++g) {
    const Group& group = groups[g];
    float low = std::numeric_limits<float>::infinity();
    float high = -low;
    for (size_t pair = 0; pair < layout.num_pairs(); ++pair) {
      for (int i = 0; i < group.count; ++i) {
        const float w = grid[pair * num_factors + group.factor + i] * scales[group.coefficient + i];
        low = std::min(low, w);
        high = std::max(high, w);
      }
    }
    const float scale = 0.5F * (high - low) / kMostCode;
    const float middle = 0.5F * (high + low);
    const float inverse = scale > 0.0F ? 1.0F / scale : 0.0F;
    float* const quantisation = &glsl.shared_values[4 * (4 + g)];
    // Codes, of factors and of BTFels, stand 2^16 times too high.
    quantisation[0] = scale / 65536.0F / 65536.0F;
    quantisation[1] = middle / 65536.0F;
    for (size_t pair = 0; pair < layout.num_pairs(); ++pair) {
      uint32_t* const words = glsl.shared_words.data() + (pair * groups.size() + g) * 4;
      for (int i = 0; i < group.count; ++i) {
        const float w = grid[pair * num_factors + group.factor + i] * scales[group.coefficient + i];
        AddCode((w - middle) * inverse, static_cast<size_t>(i), words[i / 2]);
      }
    }
  }
}

// Adds codes of some of the harmonics, and sets what one step of them is worth.
void PackFactorsUnderHarmonics(const DfmfDecoder& decoder, std::span<const float> scales,
                               const HarmonicsLayout& harmonics, HarmonicsGlsl& glsl) {
  const std::vector<Group> groups = GroupsOf(decoder);
  const int num_views = decoder.view_grid().num_nodes();
  std::vector<Eigen::MatrixXd> factors(num_views);
  for (int view = 0; view < num_views; ++view) {
    factors[view] = decoder.FactorsUnderHarmonics({{view, view, view}, {1.0, 0.0, 0.0}}, harmonics.n);
  }
  glsl.values.assign(4 * static_cast<size_t>(harmonics.luma_groups + harmonics.chroma_groups), 0.0F);
  glsl.words.assign(static_cast<size_t>(num_views) * harmonics.texels() * 4, 0);
  // Of harmonics first .. last - 1 of a group, the texel of each at a view node, at `step` from one to the
  // next; bits 8 are bytes `first_byte` and the next of each word.
  const auto pack = [&](const Group& group, int first, int last, int texel, int step, int bits,
                        int first_byte) {
    const auto factor = [&](int view, int i, int f) {
      return static_cast<float>(factors[view](group.factor + f, i)) * scales[group.coefficient + f];
    };
    float most = 0.0F;
    for (int view = 0; view < num_views; ++view) {
      for (int i = first; i < last; ++i) {
        for (int f = 0; f < group.count; ++f) {
          most = std::max(most, std::abs(factor(view, i, f)));
        }
      }
    }
    const float most_code = std::ldexp(1.0F, bits - 1) - 1.0F;
    const float inverse = most > 0.0F ? most_code / most : 0.0F;
    for (int view = 0; view < num_views; ++view) {
      for (int i = first; i < last; ++i) {
        uint32_t* const words =
            glsl.words.data() +
            (static_cast<size_t>(view) * harmonics.texels() + texel + step * (i - first)) * 4;
        for (int f = 0; f < group.count; ++f) {
          const int shift = bits * (f % 2) + 8 * first_byte;
          AddBits(factor(view, i, f) * inverse, shift, most_code, words[f / 2]);
        }
      }
    }
    // Codes stand 2^(32 - bits) times too high, those of BTFels 2^16 times.
    return std::ldexp(most / most_code, bits - 32 - 16);
  };
  const int n = harmonics.n;
  for (int g = 0; g < harmonics.luma_groups; ++g) {
    glsl.values[4 * static_cast<size_t>(g)] = pack(groups[static_cast<size_t>(g)], 0, n, g * n, 1, 16, 0);
  }
  for (int g = 0; g < harmonics.chroma_groups; ++g) {
    const int texel = harmonics.luma_texels() + g * harmonics.chroma_texels();
    float* const values = &glsl.values[4 * static_cast<size_t>(harmonics.luma_groups + g)];
    const Group& first = groups[static_cast<size_t>(harmonics.luma_groups + g)];
    const Group& second = groups[static_cast<size_t>(harmonics.luma_groups + harmonics.chroma_groups + g)];
    const int low = harmonics.num_low();
    values[0] = pack(first, 0, low, texel, 2, 16, 0);
    values[1] = pack(second, 0, low, texel + 1, 2, 16, 0);
    values[2] = pack(first, low, n, texel + 2 * low, 1, 8, 0);
    values[3] = pack(second, low, n, texel + 2 * low, 1, 8, 2);
  }
}

// What one step of each coefficient's 16-bit code is worth.
std::vector<float> CodeScales(const BtfelTable& table, std::span<const BtfelTable* const> more) {
  std::vector<float> scales(table.num_coefficients);
  std::ranges::transform(LargestMagnitudes(table, more), scales.begin(),
                         [](double largest) { return static_cast<float>(largest) / kMostCode; });
  return scales;
}

// The table's BTFels as multiples of `scales`; `words` are 0 and have room for them. Where they end.
uint32_t* PackBtfels(const BtfelTable& table, std::span<const float> scales, size_t luma_rank,
                     const Layout& layout, uint32_t* words) {
  for (size_t btfel = 0; btfel < table.size(); ++btfel) {
    const std::span<const uint8_t> codes = table.btfel(btfel);
    for (size_t i = 0; i < codes.size(); ++i) {
      const size_t place =
          i < luma_rank ? i : static_cast<size_t>(layout.luma_groups) * kGroup + (i - luma_rank);
      const float value = table.offset[i] + table.step[i] * static_cast<float>(codes[i]);
      const float code = scales[i] > 0.0F ? value / scales[i] : 0.0F;
      AddCode(code, place, words[place / 2]);
    }
    words += static_cast<ptrdiff_t>(layout.btfel_texels()) * 4;
  }
  return words;
}

}  // namespace

absl::StatusOr<CodecGlsl> DfmfGlsl(const BtfelTable& table, std::span<const BtfelTable* const> more) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<DfmfDecoder> decoder, DfmfDecoder::Create(table));
  const size_t k = table.num_coefficients;
  if (table.codes.size() % k != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(table.codes.size(), " codes are not a multiple of ", k, " coefficients"));
  }
  TESSERA_RETURN_IF_ERROR(CheckSameCoefficients(table, more));
  const Layout layout(*decoder);
  CodecGlsl glsl;
  glsl.source = Source(layout);
  glsl.shared_values.resize(4 * static_cast<size_t>(4 + layout.num_groups()));
  glsl.shared_values[0] = static_cast<float>(std::cos(decoder->max_light_theta_rad()));
  glsl.shared_values[1] = static_cast<float>(1.0 / decoder->light_grid().covered_rad());
  glsl.shared_values[2] = static_cast<float>(1.0 / decoder->view_grid().covered_rad());
  for (int j = 0; j < 3; ++j) {
    for (int channel = 0; channel < 3; ++channel) {
      glsl.shared_values[4 * (1 + j) + channel] = static_cast<float>(decoder->colour()(channel, j));
    }
  }
  const std::vector<float> scales = CodeScales(table, more);
  PackFactors(*decoder, scales, layout, glsl);

  glsl.words_per_btfel = layout.btfel_texels() * 4;
  glsl.btfel_words.resize(TotalSize(table, more) * glsl.words_per_btfel);
  const int luma_rank = decoder->luma_rank();
  uint32_t* words = PackBtfels(table, scales, luma_rank, layout, glsl.btfel_words.data());
  for (const BtfelTable* const other : more) {
    words = PackBtfels(*other, scales, luma_rank, layout, words);
  }
  return glsl;
}

absl::StatusOr<HarmonicsGlsl> DfmfHarmonicsGlsl(const BtfelTable& table,
                                                std::span<const BtfelTable* const> more, int n) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<DfmfDecoder> decoder, DfmfDecoder::Create(table));
  TESSERA_RETURN_IF_ERROR(CheckSameCoefficients(table, more));
  const Layout layout(*decoder);
  const HarmonicsLayout harmonics{layout.luma_groups, layout.chroma_groups, n};
  HarmonicsGlsl glsl{.source = SourceOfHarmonics(layout, harmonics)};
  PackFactorsUnderHarmonics(*decoder, CodeScales(table, more), harmonics, glsl);
  return glsl;
}

}  // namespace tessera
