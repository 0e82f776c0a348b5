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

// Factors under harmonics go by pairs of groups: two of luminance, which take codes of their own, then one of
// luminance that may be left, alone, then either chrominance, which take the same codes. `harmonics_words`:
// for each view node, of each pair, for each of the first harmonics a texel for either group, for each of the
// others, which matter less, one of bytes for both; of a group alone a texel for each harmonic.
// `harmonics_values`, of each pair or group alone: what one step is worth, of the first group and the second
// in 16 bits, then in bytes.
struct HarmonicsLayout {
  int luma_groups = 0;
  int chroma_groups = 0;
  int n = 0;

  [[nodiscard]] int num_low() const { return std::min(n, 4); }     // degrees 0 and 1
  [[nodiscard]] int pair_texels() const { return num_low() + n; }  // of a pair
  [[nodiscard]] int luma_pairs() const { return luma_groups / 2; }
  [[nodiscard]] bool has_single() const { return luma_groups % 2 == 1; }
  [[nodiscard]] int luma_texels() const { return luma_pairs() * pair_texels() + (has_single() ? n : 0); }
  [[nodiscard]] int luma_values() const { return luma_pairs() + (has_single() ? 1 : 0); }
  [[nodiscard]] int texels() const { return luma_texels() + chroma_groups * pair_texels(); }  // of a node
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
std::string BlendCodes(const std::string& group, int btfel_texels, const std::string& suffix = "") {
  return absl::Substitute(R"(    vec4 even_codes$2 = vec4(0.0), odd_codes$2 = vec4(0.0);
    n = 0;
    do {
      u = texelFetch(btfel_words, btfels[n] * $1 + $0);
      even_codes$2 += weights[n] * Low(u);
      odd_codes$2 += weights[n] * High(u);
    } while (++n < count);
)",
                          group, btfel_texels, suffix);
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

// GLSL of what words u0, u1 and u2 of the three nodes, read by `low` and `high`, make of the blended codes.
std::string AtNodes(const std::string& low, const std::string& high, const std::string& codes) {
  const auto at = [&](int node) {
    return absl::Substitute("dot($0(u$2), even_codes$3) + dot($1(u$2), odd_codes$3)", low, high, node, codes);
  };
  return absl::StrCat("vec3(", at(0), ", ", at(1), ", ", at(2), ")");
}

// Adds to the colour `sum` what words `texel` of the three nodes and the blended codes are under harmonic
// `i`.
std::string AddAtNodes(int texel, const std::string& sum, const std::string& low, const std::string& high,
                       const std::string& codes, int i) {
  return absl::Substitute(R"(    u0 = texelFetch(harmonics_words, at.x + $0);
    u1 = texelFetch(harmonics_words, at.y + $0);
    u2 = texelFetch(harmonics_words, at.z + $0);
    $1 += dot(view_weights, $2) * light[$3];
)",
                          texel, sum, AtNodes(low, high, codes), i);
}

// Adds a pair of groups, whose words begin at `at` and whose steps are `scales`, to the colours `first` and
// `second`; these may be the same. `codes`: the suffix of the second group's.
std::string AddPair(const HarmonicsLayout& harmonics, const std::string& first, const std::string& second,
                    const std::string& codes) {
  std::string out = "    of_first = of_second = high_first = high_second = vec3(0.0);\n";
  for (int i = 0; i < harmonics.num_low(); ++i) {
    absl::StrAppend(&out, AddAtNodes(2 * i, "of_first", "Low", "High", "", i),
                    AddAtNodes(2 * i + 1, "of_second", "Low", "High", codes, i));
  }
  for (int i = harmonics.num_low(); i < harmonics.n; ++i) {
    absl::StrAppend(&out, AddAtNodes(harmonics.num_low() + i, "high_first", "Byte0", "Byte1", "", i),
                    absl::Substitute("    high_second += dot(view_weights, $0) * light[$1];\n",
                                     AtNodes("Byte2", "High", codes), i));
  }
  absl::StrAppend(&out, absl::Substitute(R"(    $0 += scales.x * of_first + scales.z * high_first;
    $1 += scales.y * of_second + scales.w * high_second;
)",
                                         first, second));
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
  vec3 view_weights, of_first, of_second, high_first, high_second;
  vec3 luma = vec3(0.0), first_chroma = vec3(0.0), second_chroma = vec3(0.0);
  vec4 scales;
  FindNodes(view, texelFetch(codec_values, 0).z, $0, view_nodes, view_weights);
  ivec3 words = view_nodes * $1;
  uvec4 u, u0, u1, u2;
  int n, g;
)",
                       layout.view_nodes, harmonics.texels()));
  const int btfel_texels = layout.btfel_texels();
  if (harmonics.luma_pairs() > 0) {
    absl::StrAppend(
        &out, "  g = 0;\n  do {\n", BlendCodes("2 * g", btfel_texels),
        BlendCodes("2 * g + 1", btfel_texels, "1"),
        absl::Substitute("    at = words + g * $0;\n    scales = texelFetch(harmonics_values, g);\n",
                         harmonics.pair_texels()),
        AddPair(harmonics, "luma", "luma", "1"), "  } while (++g < ", harmonics.luma_pairs(), ");\n");
  }
  if (harmonics.has_single()) {
    absl::StrAppend(&out, "  {\n", BlendCodes(absl::StrCat(layout.luma_groups - 1), btfel_texels),
                    absl::Substitute("    at = words + $0;\n    of_first = vec3(0.0);\n",
                                     harmonics.luma_pairs() * harmonics.pair_texels()));
    for (int i = 0; i < harmonics.n; ++i) {
      absl::StrAppend(&out, AddAtNodes(i, "of_first", "Low", "High", "", i));
    }
    absl::StrAppend(&out, "    luma += texelFetch(harmonics_values, ", harmonics.luma_pairs(),
                    ").x * of_first;\n  }\n");
  }
  if (layout.chroma_groups > 0) {
    absl::StrAppend(&out, "  g = 0;\n  do {\n",
                    BlendCodes(absl::StrCat("g + ", layout.luma_groups), btfel_texels),
                    absl::Substitute(
                        "    at = words + $0 + g * $1;\n    scales = texelFetch(harmonics_values, $2 + g);\n",
                        harmonics.luma_texels(), harmonics.pair_texels(), harmonics.luma_values()),
                    AddPair(harmonics, "first_chroma", "second_chroma", ""), "  } while (++g < ",
                    layout.chroma_groups, ");\n");
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
  glsl.values.assign(4 * static_cast<size_t>(harmonics.luma_values() + harmonics.chroma_groups), 0.0F);
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
  const int low = harmonics.num_low();
  const auto pack_pair = [&](int first, int second, int texel, int value) {
    const Group& one = groups[static_cast<size_t>(first)];
    const Group& other = groups[static_cast<size_t>(second)];
    float* const values = &glsl.values[4 * static_cast<size_t>(value)];
    values[0] = pack(one, 0, low, texel, 2, 16, 0);
    values[1] = pack(other, 0, low, texel + 1, 2, 16, 0);
    values[2] = pack(one, low, n, texel + 2 * low, 1, 8, 0);
    values[3] = pack(other, low, n, texel + 2 * low, 1, 8, 2);
  };
  for (int g = 0; g < harmonics.luma_pairs(); ++g) {
    pack_pair(2 * g, 2 * g + 1, g * harmonics.pair_texels(), g);
  }
  if (harmonics.has_single()) {
    const int pairs = harmonics.luma_pairs();
    glsl.values[4 * static_cast<size_t>(pairs)] =
        pack(groups[static_cast<size_t>(2 * pairs)], 0, n, pairs * harmonics.pair_texels(), 1, 16, 0);
  }
  for (int g = 0; g < harmonics.chroma_groups; ++g) {
    const int first = harmonics.luma_groups + g;
    pack_pair(first, first + harmonics.chroma_groups, harmonics.luma_texels() + g * harmonics.pair_texels(),
              harmonics.luma_values() + g);
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
